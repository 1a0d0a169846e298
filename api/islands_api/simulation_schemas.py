"""Wire models of simulations that can be diagnosed: the list, equations as text, and previews."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from islands_api.schemas import DATASET_ID, Envelope, ResponseModel
from islands_service.domain.job_spec import SimulatedRecord

#: Largest numbers of characters of a text with equations and of a line: the parser of TOML takes time
#: proportional to the square of the parts of a dotted key, which is in one line.
_MAX_TEXT, _MAX_LINE = 40_000, 1000


def _check_lines(text: str) -> str:
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > _MAX_LINE:
            raise ValueError(f"line {number} has {len(line)} characters, and {_MAX_LINE} is the most")
    return text


class SimulationParameter(ResponseModel):
    """Parameter of a built-in simulation."""

    name: str
    unit: str = Field(description="With `{input}` and `{output}` for the units of the record.")
    default: float | None = Field(description="None if the parameter is estimated unless it is given.")
    range: str = Field(description="Values that it can have: any, zero or positive, or positive.")


class SimulationView(ResponseModel):
    """Simulation that a diagnosis accepts."""

    kind: str = Field(description="The `kind` of the simulation in a request.", examples=["second-order"])
    summary: str
    estimated: str = Field(
        description="What is estimated from the record unless it is given; empty if nothing is."
    )
    parameters: tuple[SimulationParameter, ...] = Field(
        description="Those of a physical system; empty for other simulations, whose request defines them."
    )
    equations: str = Field(
        description="The equations of a physical system as a TOML file, which can be changed; or empty."
    )
    refusal: str = Field(
        default="", description="Why this service does not accept it, and what to do. Empty if it does."
    )


class SimulationList(ResponseModel):
    """All simulations that a diagnosis accepts."""

    items: tuple[SimulationView, ...]


class EquationsRequest(BaseModel):
    """Differential equations as the text of a TOML file."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {
                    "text": 'input = "u"\noutput = "x"\nequations = """\ndx/dt = (u - x)/tau\n"""\n\n'
                    '[parameters]\ntau = { value = 0.2, unit = "s" }\n'
                }
            ]
        },
    )

    text: Annotated[
        str, Field(max_length=_MAX_TEXT, description="Content of the file."), AfterValidator(_check_lines)
    ]


class EquationsView(ResponseModel):
    """Valid differential equations, in the form of the `simulation` of a request."""

    kind: Literal["ode"]
    name: str
    input: str
    channels: tuple[str, ...] = ()
    equations: str
    output: str
    parameters: dict[str, Any] = Field(default={}, description="Value, unit and limits of each parameter.")
    states: dict[str, Any] = Field(default={}, description="Unit, initial value and limits of each state.")


class PreviewRequest(SimulatedRecord):
    """A simulation to calibrate on a part of a record."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "dataset": DATASET_ID,
                    "input": "u_V",
                    "output": "y_um",
                    "simulation": {"kind": "linear", "order": 2},
                }
            ]
        }
    )

    points: Annotated[int, Field(ge=1, le=5000, description="Most values of a signal.")] = 2000


class CalibratedParameter(ResponseModel):
    """Calibrated parameter of a simulation."""

    name: str
    unit: str
    value: float


class SimulationPreview(ResponseModel):
    """A simulation that is calibrated on a part of a record, and the measured output."""

    simulation: str = Field(description="Name of the simulation.")
    start: int = Field(description="First sample, from 0, of the part in the rows of the request.")
    stop: int = Field(description="Sample after the last one.")
    samples: int = Field(description="Samples of the rows of the request.")
    estimation_samples: int = Field(description="Samples of the part, from its first, that calibrated it.")
    dt: float = Field(description="Sampling time in seconds.")
    unit: str = Field(description="Unit of the output.")
    rows: tuple[int, ...] = Field(description="First sample of every part of the plotted signals.")
    columns: tuple[Envelope, ...] = Field(description="The signals `measured` and `simulated`.")
    error_percent: float = Field(
        description="Mean absolute error over the part, in per cent of the range of the measured output."
    )
    parameters: tuple[CalibratedParameter, ...]
