"""Wire models of the response of a model to inputs of choice."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, FiniteFloat, Tag

from islands_api.schemas import ResponseModel
from islands_service.domain.job_spec import Name

#: Largest number of samples of a response.
MAX_SAMPLES = 50_000

_Frequency = Annotated[FiniteFloat, Field(gt=0.0)]


class _Excitation(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Hold(_Excitation):
    """A constant input."""

    kind: Literal["hold"]
    value: FiniteFloat


class Wave(_Excitation):
    """A periodic input; steps are offset, offset + amplitude, offset, offset - amplitude."""

    kind: Literal["sine", "triangle", "steps"]
    amplitude: FiniteFloat = Field(description="In the unit of the input.")
    offset: FiniteFloat = Field(default=0.0, description="First value and mean of the input.")
    frequency: _Frequency = Field(description="In Hz; at most half the sampling frequency of the model.")


class Sweep(_Excitation):
    """A sine whose frequency changes from the first to the last sample (linear chirp)."""

    kind: Literal["sweep"]
    amplitude: FiniteFloat = Field(description="In the unit of the input.")
    offset: FiniteFloat = Field(default=0.0, description="First value and mean of the input.")
    first: _Frequency = Field(description="First frequency in Hz.")
    last: _Frequency = Field(description="Last frequency in Hz; at most half the sampling frequency.")


class RecordedInput(_Excitation):
    """The input of the record from its first sample, multiplied by a factor and shifted."""

    kind: Literal["record"]
    scale: FiniteFloat = 1.0
    offset: FiniteFloat = Field(default=0.0, description="Added to the scaled input, in its unit.")


def _choose_form(given: Any) -> str:
    return "numbers" if isinstance(given, list) else "excitation"


#: Samples of an input. The first number that is wrong ends the validation, which would take long otherwise.
Numbers = Annotated[list[FiniteFloat], Field(min_length=1, max_length=MAX_SAMPLES, fail_fast=True)]

Excitation = Annotated[Hold | Wave | Sweep | RecordedInput, Field(discriminator="kind")]

Input = Annotated[
    Annotated[Numbers, Tag("numbers")] | Annotated[Excitation, Tag("excitation")],
    Discriminator(_choose_form),
]


class SimulationRequest(BaseModel):
    """Inputs of a model, each an excitation or its samples at the sampling time of the model."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        json_schema_extra={
            "examples": [
                {
                    "inputs": {"u_V": {"kind": "sine", "amplitude": 30.0, "offset": 50.0, "frequency": 2.0}},
                    "samples": 5000,
                },
                {"inputs": {"u_V": [0.0, 1.0, 2.0, 1.0]}, "initial_output": 0.0},
            ]
        },
    )

    inputs: Annotated[dict[Name, Input], Field(max_length=16)] = Field(
        default={},
        description="By column. Others are held in the middle of their range in the estimation data.",
    )
    samples: Annotated[int, Field(ge=1, le=MAX_SAMPLES)] | None = Field(
        default=None, description="Number of samples; by default that of the given numbers, or 2000."
    )
    initial_output: FiniteFloat | None = Field(
        default=None,
        description="Output before the first sample. By default the model rests in its stable equilibrium at "
        "the first values of the inputs; a model without a unique one starts from the first measured output "
        "of the record.",
    )


class SimulatedOutput(ResponseModel):
    """Response of a model to inputs of choice."""

    dt: float = Field(description="Sampling time of the model in seconds.")
    time_s: tuple[float, ...]
    inputs: dict[str, tuple[float, ...]]
    output: tuple[float | None, ...] = Field(description="Null from a divergence on.")
    initial_output: float = Field(description="Output before the first sample.")
    start: str = Field(description="Where the initial output is from, in a sentence.")
    outcome: str = Field(description="`ok`, or where the output diverged.")
    warnings: tuple[str, ...] = Field(
        description="Inputs that leave the range of the estimation data, divergence, missing samples."
    )
    ranges: dict[str, tuple[float, float]] = Field(
        description="Least and largest value of every input in the estimation data, if the result has them."
    )
    units: dict[str, str] = Field(description="Units of the inputs and of the output, by column.")
