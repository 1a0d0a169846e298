"""Specifications of simulations that are code: a Python function, or an FMU with the variables that are used.

They are accepted on the command line and in Python only, since the code runs on this machine.
"""

import re
import tomllib
from collections.abc import Callable
from math import isinf
from pathlib import Path
from typing import Annotated, Any, Literal
from urllib.parse import parse_qsl

from pydantic import BeforeValidator, Field, FiniteFloat

from islands.errors import SettingsError
from islands.simulators.fmu.fmi_description import FmiDescription, read_description
from islands.simulators.fmu.model import FmuModel, FmuParameterChoice, choose_variables
from islands.simulators.fmu.system import make_fmu_system, render_extension
from islands.simulators.ode.equation_parser import MAX_CHARACTERS
from islands.simulators.ode.system import OdeSystem
from islands.simulators.ode.system_document import MAX_PARAMETERS, describe_system, make_force, make_parameter
from islands.simulators.specification.base import SimulatorSpec, SpecModel
from islands.simulators.specification.equations import OdeForceSpec, OdeParameterSpec

_Name = Annotated[str, Field(min_length=1, max_length=500)]

#: Options behind the file name that are lists of names.
_LISTS = ("channels", "initial", "parameters")

#: Name in a list with commas; a name can contain others in brackets, as ``K[1,2]``.
_LISTED = re.compile(r"(?:\[[^\[\]]*\]|[^,])+")


class ProgramSpec(SimulatorSpec):
    """A Python function in a file."""

    kind: Literal["python"]
    path: str
    function: str
    parameters: dict[str, FiniteFloat] = Field(default_factory=dict, max_length=64)

    @classmethod
    def from_text(cls, kind: str, text: str) -> "ProgramSpec":
        """Parse ``FILE.py:FUNCTION``."""
        path, _, function = text.rpartition(":")
        return cls.model_validate({"kind": kind, "path": path, "function": function})


class FmuParameterSpec(SpecModel):
    """Parameter of an FMU; the model description has the defaults. See `FmuParameter`."""

    value: FiniteFloat | None = None
    tolerance: FiniteFloat | None = None
    lower: FiniteFloat | None = None
    upper: FiniteFloat | None = None
    fixed: bool = False


def _allow_number(given: Any) -> Any:
    return {"value": given} if isinstance(given, int | float) else given


class FmuSpec(SimulatorSpec):
    """Functional Mock-up Unit."""

    kind: Literal["fmu"]
    file: _Name
    interface: Literal["", "co-simulation", "model-exchange"] = ""
    input: str = ""
    output: str = ""
    channels: Annotated[tuple[_Name, ...], Field(max_length=15)] = ()
    parameters: dict[_Name, Annotated[FmuParameterSpec, BeforeValidator(_allow_number)]] | None = Field(
        default=None, max_length=100
    )
    initial: Annotated[tuple[_Name, ...], Field(max_length=100)] | None = None
    steps: Annotated[int, Field(ge=0, le=256)] = 0
    equations: Annotated[str, Field(max_length=MAX_CHARACTERS)] = ""
    coefficients: dict[_Name, Annotated[OdeParameterSpec, BeforeValidator(_allow_number)]] = Field(
        default_factory=dict, max_length=MAX_PARAMETERS
    )
    force: OdeForceSpec | None = None

    @property
    def name(self) -> str:
        """Name of the file."""
        return Path(self.file).name

    def make_model(self, describe: Callable[[str, str], FmiDescription] = read_description) -> FmuModel:
        """Return the FMU with its variables.

        Parameters
        ----------
        describe : callable
            Takes the file and the interface; by default it reads the file.

        Raises
        ------
        ModelError
            The file is not an FMU for this machine.
        SettingsError
            It has not the variables, or fmpy is not installed.
        """
        chosen = self.parameters
        return choose_variables(
            describe(self.file, self.interface),
            self.input,
            self.output,
            self.channels,
            None
            if chosen is None
            else {name: FmuParameterChoice(**each.model_dump()) for name, each in chosen.items()},
            self.initial,
            self.steps,
        )

    def make_system(self, model: FmuModel) -> OdeSystem:
        """Return the equations around the FMU.

        Raises
        ------
        ModelError
            The equations, their coefficients or the coordinate of forces are invalid.
        """
        coefficients = [make_parameter(name, each.model_dump()) for name, each in self.coefficients.items()]
        force = (
            None
            if self.force is None
            else make_force(model.symbols[model.input.name], self.force.model_dump())
        )
        return make_fmu_system(model, self.equations, coefficients, force)

    @classmethod
    def from_system(cls, model: FmuModel, system: OdeSystem) -> "FmuSpec":
        """Return the specification of an FMU with its variables and the equations around it."""
        values = {parameter.name: parameter.value for parameter in system.parameters}
        own = {parameter.variable.name for parameter in model.parameters}
        described = describe_system(system)
        return cls(
            kind="fmu",
            file=model.description.path,
            interface=model.description.interface.value,
            input=model.input.name,
            output=model.output.name,
            channels=tuple(channel.name for channel in model.channels),
            parameters={
                parameter.variable.name: FmuParameterSpec(
                    value=values[parameter.variable.name],
                    tolerance=parameter.tolerance,
                    lower=None if isinf(parameter.lower) else parameter.lower,
                    upper=None if isinf(parameter.upper) else parameter.upper,
                    fixed=parameter.fixed,
                )
                for parameter in model.parameters
            },
            initial=tuple(each.variable.name for each in model.initial),
            steps=system.steps,
            equations=render_extension(model, system),
            coefficients={
                name: OdeParameterSpec.model_validate(entry)
                for name, entry in described.get("parameters", {}).items()
                if name not in own
            },
            force=OdeForceSpec.model_validate(described["force"])
            if system.force and system.force.rate
            else None,
        )

    @classmethod
    def from_text(cls, kind: str, text: str) -> "FmuSpec":
        """Parse ``FILE.fmu?input=NAME&parameters=NAME,NAME=VALUE``, or the path of a TOML file."""
        if text.endswith(".toml"):
            return cls._from_file(kind, Path(text))
        file, _, query = text.partition("?")
        options: dict[str, Any] = {}
        try:
            given = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
        except ValueError:
            raise SettingsError(f"{query}: write OPTION=VALUE&OPTION=VALUE behind {file}?") from None
        for name, value in given:
            options[name] = _LISTED.findall(value) if name in _LISTS else value
        if "parameters" in options:
            options["parameters"] = dict(map(_parse_parameter, options["parameters"]))
        return cls.model_validate({**options, "kind": kind, "file": file})

    @classmethod
    def _from_file(cls, kind: str, path: Path) -> "FmuSpec":
        """Read a TOML file; the FMU that it names is relative to its folder."""
        try:
            document = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise SettingsError(f"{path} cannot be read as TOML ({error}): write fmu:FILE.toml") from error
        if isinstance(document.get("file"), str):
            document["file"] = str(path.parent / document["file"])
        return cls.model_validate({**document, "kind": kind})


def _parse_parameter(text: str) -> tuple[str, dict[str, str]]:
    name, _, value = text.partition("=")
    return name, {"value": value} if value else {}
