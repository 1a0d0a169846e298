"""Wire models of uploaded FMUs: their inputs, outputs, parameters and values at the first sample."""

from datetime import datetime

from pydantic import Field

from islands_api.schemas import ResponseModel

_FMU_ID = "9f86d081884c7d659a2feaa0c55ad015-fmu"


class FmuVariableView(ResponseModel):
    """Variable of type real of an FMU."""

    name: str
    unit: str
    start: float | None = Field(description="Value that it has unless another one is set.")
    lower: float | None = Field(description="Least value. None without a limit.")
    upper: float | None = Field(description="Greatest value. None without a limit.")


class FmuSummary(ResponseModel):
    """Uploaded FMU in a list."""

    id: str = Field(description="The `file` of a simulation of the `kind` fmu.", examples=[_FMU_ID])
    name: str
    sha256: str
    bytes: int
    created: datetime


class FmuView(FmuSummary):
    """Uploaded FMU."""

    fmi: int = Field(description="Version of FMI: 2 or 3.")
    interface: str = Field(description="Interface by which it is simulated: model exchange if it has both.")
    inputs: tuple[FmuVariableView, ...]
    outputs: tuple[FmuVariableView, ...]
    parameters: tuple[FmuVariableView, ...] = Field(description="Parameters that can be calibrated.")
    initial: tuple[FmuVariableView, ...] = Field(
        description="Values at the first sample of a record that can be calibrated."
    )
    most_parameters: int = Field(
        description="If there are more, a simulation has to name those it calibrates."
    )


class FmuPage(ResponseModel):
    """Page of FMUs, newest first."""

    items: tuple[FmuSummary, ...]
    next: str | None = Field(default=None, description="Cursor of the next page. None on the last page.")
