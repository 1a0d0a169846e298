"""Specifications of simulators: text on the command line, JSON over REST, and the table of all simulators.

This module checks specifications and does not import the kernels; `islands.simulators.specification.factory`
makes simulators. To add a simulator, write its class and add an entry to `SIMULATORS`.
"""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from pydantic import ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from islands.document_problems import find_problem
from islands.errors import ModelError, SettingsError, lookup
from islands.simulators.ode.system_document import MAX_STATES, MAX_STEPS
from islands.simulators.specification.base import (
    EffectSpec,
    ParameterRange,
    ScalesSpec,
    SignalRangeSpec,
    SimulatorEntry,
    SimulatorSpec,
    SpecModel,
    read_object,
)
from islands.simulators.specification.code import FmuSpec, ProgramSpec
from islands.simulators.specification.equations import OdeSpec, OutputEquationSpec

#: Name of the file of an extended simulation in the folder of a diagnosis.
EXTENDED_FILE = "extended.json"

EXTENDED_SCHEMA: Literal["islands.extended/1"] = "islands.extended/1"


class PhysicalSpec(SimulatorSpec):
    """A physical system; parameters that are not given have their nominal value or are estimated.

    With 0 ``steps`` per sample, the record determines them.
    """

    kind: "PhysicalKind"
    parameters: dict[str, FiniteFloat] = Field(default_factory=dict, max_length=32)
    steps: Annotated[int, Field(ge=0, le=MAX_STEPS)] = 0

    @classmethod
    def from_text(cls, kind: str, text: str) -> "LocalSpec":
        """Parse the path of a JSON file with parameters, or nothing."""
        return cls(kind=kind, parameters=read_object(text, SettingsError) if text else {})


class LinearSpec(SimulatorSpec):
    """A linear model, given by its coefficients or estimated from the estimation part of the record.

    It has ``order`` poles and as many zeros; the input is delayed by ``delay`` samples. The coefficients are
    those of u(k - delay), u(k - delay - 1), ... and of y(k-1), y(k-2), ...; ``level`` is the output at rest
    at the input ``reference_input``, which is the first sample of the record if it is not given.
    """

    kind: Literal["linear"]
    order: Annotated[int, Field(ge=0, le=10)]
    delay: Annotated[int, Field(ge=0, le=1000)] = 0
    numerator: tuple[FiniteFloat, ...] | None = Field(default=None, max_length=11)
    denominator: tuple[FiniteFloat, ...] = Field(default=(), max_length=10)
    level: FiniteFloat = 0.0
    reference_input: FiniteFloat | None = None

    @model_validator(mode="after")
    def _check_number_of_coefficients(self) -> "LinearSpec":
        if self.numerator is not None and (len(self.numerator), len(self.denominator)) != (
            self.order + 1,
            self.order,
        ):
            raise ValueError(f"order {self.order} takes {self.order + 1} and {self.order} coefficients")
        return self

    @classmethod
    def from_text(cls, kind: str, text: str) -> "LocalSpec":
        """Parse ``ORDER`` or ``ORDER:DELAY``."""
        order, _, delay = text.partition(":")
        return cls.model_validate({"kind": kind, "order": order, "delay": delay or 0})


class ModelSpec(SimulatorSpec):
    """An identified model: the content of a model file."""

    kind: Literal["model"]
    model: dict[str, Any]
    name: str = Field(default="model", max_length=200)

    @classmethod
    def from_text(cls, kind: str, text: str) -> "LocalSpec":
        """Parse the path of a model file or of an extended simulation."""
        document = read_object(text, ModelError)
        if document.get("schema") == EXTENDED_SCHEMA:
            return LocalExtendedSpec.model_validate(document)
        return cls.model_validate({"kind": kind, "model": document, "name": f"model {Path(text).name}"})


class ColumnSpec(SimulatorSpec):
    """A column of the record: the output of another simulation."""

    kind: Literal["column"]
    column: Annotated[str, Field(min_length=1, max_length=200)]

    @classmethod
    def from_text(cls, kind: str, text: str) -> "LocalSpec":
        """Parse the name of a column."""
        return cls.model_validate({"kind": kind, "column": text})


class ExtendedSpec(SpecModel):
    """A simulator with effects, as a diagnosis writes it, and the states at its first sample (``start``)."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True, serialize_by_alias=True)

    kind: Literal["extended"] = "extended"
    schema_version: Annotated[Literal["islands.extended/1"], Field(alias="schema")] = EXTENDED_SCHEMA
    inputs: tuple[str, ...]
    output: str
    core: "SimulationSpec"
    hold: Literal["first-order", "zero-order", "band-limited"] = "first-order"
    times: Annotated[int, Field(ge=1, le=64)] = 1
    effects: tuple[EffectSpec, ...]
    output_equation: OutputEquationSpec | None = None
    start: dict[str, FiniteFloat] = Field(default_factory=dict, max_length=MAX_STATES)
    scales: ScalesSpec
    tested: tuple[SignalRangeSpec, ...] = Field(default=(), max_length=32)


class LocalExtendedSpec(ExtendedSpec):
    """A simulator with effects, which may be a Python function or an FMU."""

    core: "LocalSpec"  # type: ignore[assignment]


_ESTIMATORS = "islands.simulators.built_in_estimates"
_FACTORY = "islands.simulators.specification.factory"

_ENTRIES = (
    SimulatorEntry(
        "bouc-wen-piezo",
        "[:FILE.json]",
        "Piezoelectric actuator: y = dp u - h, h' = A u' - beta |u'| h - gamma u' |h|. Parameters that "
        "are not given have the values of the paper",
        PhysicalSpec,
        f"{_FACTORY}:make_built_in",
        dict.fromkeys(("A", "beta", "gamma", "dp"), ParameterRange.REAL),
    ),
    SimulatorEntry(
        "second-order",
        "[:FILE.json]",
        "Oscillator: m x'' + c x' + k x = u, y = x",
        PhysicalSpec,
        f"{_FACTORY}:make_built_in",
        dict.fromkeys(("m", "c", "k"), ParameterRange.REAL),
        estimated="m, c, k; position and rate at the first sample",
        estimator=f"{_ESTIMATORS}:estimate_oscillator",
    ),
    SimulatorEntry(
        "rigid-axis",
        "[:FILE.json]",
        "Axis with friction: m x'' + c x' + F tanh(x' / vs) = u, y = x. It restarts every half second "
        "from a state fitted to the measured output (multiple shooting), because its free run drifts",
        PhysicalSpec,
        f"{_FACTORY}:make_built_in",
        {
            "m": ParameterRange.POSITIVE,
            "c": ParameterRange.NONNEGATIVE,
            "F": ParameterRange.NONNEGATIVE,
            "vs": ParameterRange.POSITIVE,
        },
        estimated="m, c, F, vs",
        estimator=f"{_ESTIMATORS}:estimate_axis",
    ),
    SimulatorEntry(
        "cascaded-tanks",
        "[:FILE.json]",
        "Two tanks: x1' = k3 u - k1 sqrt(x1), x2' = k1 sqrt(x1) - k2 sqrt(x2), y = x2",
        PhysicalSpec,
        f"{_FACTORY}:make_built_in",
        dict.fromkeys(("k1", "k2", "k3"), ParameterRange.POSITIVE),
        estimated="k1, k2, k3; both levels at the first sample",
        estimator=f"{_ESTIMATORS}:estimate_tanks",
    ),
    SimulatorEntry(
        "ode",
        ":FILE.toml",
        "Differential equations that you write: a file with equations, parameters and states",
        OdeSpec,
        f"{_FACTORY}:make_ode",
        estimated="the states at the first sample",
    ),
    SimulatorEntry(
        "linear",
        ":ORDER[:DELAY]",
        "Linear model of order 0 to 10, with as many zeros as poles; the input acts DELAY samples late",
        LinearSpec,
        f"{_FACTORY}:make_linear",
        estimated="all coefficients, the level and the initial state",
    ),
    SimulatorEntry(
        "model",
        ":FILE.json",
        "Identified model with one input, in free run; or an extended simulation (`extended.json`)",
        ModelSpec,
        f"{_FACTORY}:make_identified_model",
        estimated="all parameters except those of terms that are linear in the output alone",
    ),
    SimulatorEntry(
        "column",
        ":NAME",
        "Column of the record: the output of another simulation. Effects on its input or in its equation "
        "cannot be searched for",
        ColumnSpec,
        f"{_FACTORY}:make_recorded_output",
    ),
    SimulatorEntry(
        "python",
        ":FILE.py:FUNCTION",
        "Function `(u, dt, **parameters)` that returns the output; arguments with a number as default "
        "are parameters. The file is executed, so REST does not accept it",
        ProgramSpec,
        f"{_FACTORY}:make_python_function",
        estimated="its parameters",
        is_remote=False,
    ),
    SimulatorEntry(
        "fmu",
        ":FILE.fmu[?OPTIONS]",
        "Functional Mock-up Unit of FMI 2.0 or 3.0, as Simulink, Dymola, OpenModelica and other tools "
        "export it. It is native code, which a service runs only if its operator allows it",
        FmuSpec,
        f"{_FACTORY}:make_fmu",
        estimated="its parameters, the states at the first sample",
        is_remote=False,
    ),
)

#: All simulators by name.
SIMULATORS: Mapping[str, SimulatorEntry] = MappingProxyType({entry.name: entry for entry in _ENTRIES})

if TYPE_CHECKING:
    PhysicalKind: TypeAlias = str
else:
    PhysicalKind = Literal[tuple(entry.name for entry in _ENTRIES if entry.spec is PhysicalSpec)]

# Type checkers require explicit unions; a test compares both with the table.
#: Specifications that REST accepts.
SimulationSpec: TypeAlias = Annotated[
    PhysicalSpec | OdeSpec | LinearSpec | ModelSpec | ColumnSpec | ExtendedSpec, Field(discriminator="kind")
]

#: Specifications that the command line and the Python functions accept.
LocalSpec: TypeAlias = Annotated[
    PhysicalSpec | OdeSpec | LinearSpec | ModelSpec | ColumnSpec | LocalExtendedSpec | ProgramSpec | FmuSpec,
    Field(discriminator="kind"),
]

PhysicalSpec.model_rebuild()
ExtendedSpec.model_rebuild()
LocalExtendedSpec.model_rebuild()


def parse_spec(text: str) -> LocalSpec:
    """Parse ``NAME`` or ``NAME:ARGUMENTS``, the form of a simulator on the command line.

    Raises
    ------
    SettingsError, ModelError
        There is no such simulator, its arguments are invalid, or a file cannot be read.
    """
    kind, _, arguments = text.partition(":")
    entry = lookup(SIMULATORS, kind, "simulation")
    try:
        spec: LocalSpec = entry.spec.from_text(kind, arguments)
    except ValidationError as error:
        raise SettingsError(": ".join(filter(None, (text, *find_problem(error, entry.spec))))) from error
    return spec


def innermost(spec: SimulationSpec | LocalSpec) -> SimulationSpec | LocalSpec:
    """Return the specification of the simulator without effects."""
    while isinstance(spec, ExtendedSpec):
        spec = spec.core
    return spec


def find_extended_file(path: str) -> str:
    """Return the extended simulation in the folder of a diagnosis. Any other path is returned as it is."""
    file = Path(path) / EXTENDED_FILE
    return str(file) if file.is_file() else path


def is_extended(path: str) -> bool:
    """Return whether a file holds an extended simulation; False if it cannot be read."""
    try:
        return read_object(path, ModelError).get("schema") == EXTENDED_SCHEMA
    except ModelError:
        return False
