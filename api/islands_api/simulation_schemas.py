"""Wire models of simulations that can be diagnosed, and of responses of a model to inputs of choice."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, FiniteFloat, Tag

from islands_api.schemas import DATASET_ID, Envelope, ResponseModel
from islands_service.domain.job_spec import Name, Part, SimulatedRecord

#: Largest numbers of characters of a text with equations and of a line: the parser of TOML takes time
#: proportional to the square of the parts of a dotted key, which is in one line.
_MAX_TEXT, _MAX_LINE = 40_000, 1000

#: Largest number of samples of a response.
MAX_SAMPLES = 50_000

_Frequency = Annotated[FiniteFloat, Field(gt=0.0)]


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
    initial_output: FiniteFloat | Annotated[dict[Name, FiniteFloat], Field(max_length=16)] | None = Field(
        default=None,
        description="Output before the first sample, of several outputs by column. By default the model "
        "rests in its stable equilibrium at the first values of the inputs; a model without a unique one "
        "starts from the first measured output of the record.",
    )


class SimulatedOutput(ResponseModel):
    """Response of a model to inputs of choice."""

    dt: float = Field(description="Sampling time of the model in seconds.")
    time_s: tuple[float, ...]
    inputs: dict[str, tuple[float, ...]]
    outputs: dict[str, tuple[float | None, ...]] = Field(description="By column. Null from a divergence on.")
    initial_outputs: dict[str, float] = Field(description="Outputs before the first sample, by column.")
    start: str = Field(description="Where the initial outputs are from, in a sentence.")
    outcome: str = Field(description="`ok`, or where an output diverged.")
    warnings: tuple[str, ...] = Field(
        description="Inputs that leave the range of the estimation data, divergence, missing samples."
    )
    ranges: dict[str, tuple[float, float]] = Field(
        description="Least and largest value of every input in the estimation data, if the result has them."
    )
    units: dict[str, str] = Field(description="Units of the inputs and of the outputs, by column.")


class ScenarioRequest(BaseModel):
    """Data sets that a model simulates, one after the other, and their common start."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        json_schema_extra={
            "examples": [{"datasets": [{"dataset": DATASET_ID}], "start": {"y_um": 0.0}}],
        },
    )

    datasets: Annotated[tuple[Part, ...], Field(min_length=1, max_length=16)] = Field(
        description="Records of the inputs alone, or with the outputs, which have their names in the model."
    )
    start: Annotated[dict[Name, FiniteFloat], Field(max_length=64)] = Field(
        default={},
        description="Outputs before the first sample, or the states `x1`, `x2`, ... of a latent model at it. "
        "By default the measured outputs, and without any the rest at the first inputs.",
    )
    dt: Annotated[FiniteFloat, Field(gt=0.0)] | None = Field(
        default=None, description="Sampling time in seconds of data sets that do not state it."
    )


class Scenario(ResponseModel):
    """Free run of a model on a data set."""

    dataset: str
    dt: float = Field(description="Sampling time of the model in seconds.")
    time_s: tuple[float, ...]
    outputs: dict[str, tuple[float | None, ...]] = Field(
        description="By column. Null before the first prediction, and from a divergence on."
    )
    units: dict[str, str] = Field(description="Units of the outputs, by column.")
    start: str = Field(description="Where the simulation starts, in words.")
    outcome: str = Field(description="`ok`, or where the output diverged.")
    warnings: tuple[str, ...] = Field(description="Inputs that leave the range of the estimation data.")


class ScenarioPage(ResponseModel):
    """Free runs in the order of the data sets."""

    items: tuple[Scenario, ...]
