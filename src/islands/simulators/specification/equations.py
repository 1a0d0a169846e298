"""Specification of a simulator that a user writes as equations: a TOML file, or its content as JSON."""

import tomllib
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, FiniteFloat, ValidationInfo, model_validator
from pydantic_core import PydanticCustomError

from islands.errors import ModelError, SettingsError
from islands.simulators.ode.equation_parser import MAX_CHARACTERS
from islands.simulators.ode.system import OdeSystem
from islands.simulators.ode.system_document import (
    MAX_PARAMETERS,
    MAX_STATES,
    MAX_STEPS,
    describe_system,
    make_output_system,
    make_system,
)
from islands.simulators.specification.base import SimulatorSpec, SpecModel

_Name = Annotated[str, Field(min_length=1, max_length=100)]
_Unit = Annotated[str, Field(max_length=50)]


class OdeParameterSpec(SpecModel):
    """Parameter of equations; see `OdeParameter`."""

    value: FiniteFloat
    unit: _Unit = ""
    tolerance: FiniteFloat | None = None
    lower: FiniteFloat | None = None
    upper: FiniteFloat | None = None
    fixed: bool = False
    positive: bool = False


class OdeStateSpec(SpecModel):
    """State of equations; see `OdeState`."""

    unit: _Unit = ""
    initial: FiniteFloat | None = None
    fixed: bool = False
    lower: FiniteFloat | None = None
    upper: FiniteFloat | None = None
    spills_into: Annotated[str, Field(max_length=100)] = ""


class OdeForceSpec(SpecModel):
    """Coordinate of force laws; see `OdeForce`."""

    coordinate: _Name
    rate: Annotated[str, Field(max_length=100)] = ""
    unit: _Unit = ""
    drive: Annotated[str, Field(max_length=500)] = ""


class OdeEffectSpec(SpecModel):
    """Term of an effect; see `OdeEffect`."""

    equation: Annotated[str, Field(max_length=100)] = ""
    term: Annotated[str, Field(max_length=500)] = ""


def _allow_number(given: Any) -> Any:
    return {"value": given} if isinstance(given, int | float) else given


_Parameters = Annotated[
    dict[_Name, Annotated[OdeParameterSpec, BeforeValidator(_allow_number)]], Field(max_length=MAX_PARAMETERS)
]


class OutputEquationSpec(SpecModel):
    """Equation of the output around a simulation without equations; see `OutputEquation`."""

    equation: Annotated[str, Field(min_length=1, max_length=2000)]
    parameters: _Parameters

    @model_validator(mode="after")
    def _check_equation(self) -> "OutputEquationSpec":
        try:
            self.make_system("simulation")
        except ModelError as error:
            raise PydanticCustomError("equation", "{why}", {"why": str(error)}) from error
        return self

    def make_system(self, name: str) -> OdeSystem:
        """Return the equation of the output of a simulation of a given name."""
        given = self.model_dump(exclude_defaults=True)["parameters"]
        return make_output_system(name, self.equation, given)

    @classmethod
    def from_system(cls, system: OdeSystem) -> "OutputEquationSpec":
        """Return the specification of an equation of the output."""
        described = describe_system(system)
        return cls(equation=described["output"], parameters=described["parameters"])


class OdeSpec(SimulatorSpec):
    """Differential equations, given as text, with their parameters and states."""

    kind: Literal["ode"]
    name: _Name
    summary: Annotated[str, Field(max_length=500)] = ""
    input: _Name
    channels: Annotated[tuple[_Name, ...], Field(max_length=15)] = ()
    equations: Annotated[str, Field(max_length=MAX_CHARACTERS)]
    output: Annotated[str, Field(min_length=1, max_length=2000)]
    parameters: _Parameters = Field(default_factory=dict)
    states: Annotated[dict[_Name, OdeStateSpec], Field(max_length=MAX_STATES)] = Field(default_factory=dict)
    force: OdeForceSpec | None = None
    input_unit: _Unit = ""
    output_unit: _Unit = ""
    steps: Annotated[int, Field(ge=0, le=MAX_STEPS)] = 0
    shooting: Annotated[FiniteFloat, Field(ge=0.0)] = 0.0
    gain: Annotated[str, Field(max_length=100)] = ""
    contains: Annotated[tuple[_Name, ...], Field(max_length=20)] = ()
    effects: Annotated[dict[_Name, OdeEffectSpec], Field(max_length=50)] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check_equations(self, _info: ValidationInfo) -> "OdeSpec":
        try:
            self.make_system()
        except ModelError as error:
            raise PydanticCustomError("equations", "{why}", {"why": str(error)}) from error
        return self

    def make_system(self) -> OdeSystem:
        """Return the system of the specification."""
        return make_system(self.model_dump(exclude_defaults=True, exclude={"kind"}))

    @classmethod
    def from_system(cls, system: OdeSystem) -> "OdeSpec":
        """Return the specification of a system."""
        return cls.model_validate({"kind": "ode", **describe_system(system)})

    @classmethod
    def from_text(cls, kind: str, text: str) -> "OdeSpec":
        """Parse the path of a TOML file."""
        try:
            content = Path(text).read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            raise SettingsError(f"{text} cannot be read as text ({error}): write {kind}:FILE.toml") from error
        return cls.from_toml(content, text, Path(text).stem)

    @classmethod
    def from_toml(cls, content: str, place: str, name: str) -> "OdeSpec":
        """Parse the content of a TOML file.

        Parameters
        ----------
        content : str
        place : str
            What the content is, for messages.
        name : str
            Name of equations that have none.

        Raises
        ------
        SettingsError
            The content is not TOML. The message has line and column.
        ValidationError
            The equations are invalid. The message has the line.
        """
        try:
            document = tomllib.loads(content)
        except (ValueError, RecursionError) as error:
            raise SettingsError(
                f"{place} cannot be read as TOML ({error}): write NAME = VALUE, and texts in quotes"
            ) from error
        return cls.model_validate({"name": name, **document, "kind": "ode"})


def read_built_in_text(name: str) -> str:
    """Return the TOML file with the equations of a built-in simulator."""
    return files("islands.simulators").joinpath("built_in", f"{name}.toml").read_text(encoding="utf-8")


@cache
def read_built_in(name: str) -> OdeSystem:
    """Return the equations of a built-in simulator."""
    return replace(OdeSpec.from_toml(read_built_in_text(name), name, name).make_system(), is_built_in=True)
