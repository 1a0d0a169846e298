"""Wire models of simulations that can be diagnosed: the list, and equations as text."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from islands_api.schemas import ResponseModel

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
