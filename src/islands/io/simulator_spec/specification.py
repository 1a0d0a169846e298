"""Simulations as they are asked for: a text on the command line, JSON over REST.

Specifications are checked here. Simulators are made in `islands.io.simulator_spec.factory`, which needs the
kernels.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    PositiveFloat,
    ValidationError,
    model_validator,
)

from islands.errors import ModelError, SettingsError

EXTENDED_SCHEMA: Literal["islands.extended/1"] = "islands.extended/1"

#: Parameters of the physical systems that can be given.
PARAMETERS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "bouc-wen-piezo": ("A", "beta", "gamma", "dp"),
        "second-order": ("m", "c", "k"),
        "rigid-axis": ("m", "c", "F", "vs"),
        "cascaded-tanks": ("k1", "k2", "k3"),
    }
)


class _Spec(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PhysicalSpec(_Spec):
    """A physical system of ours; parameters that are not given are nominal, or estimated where nothing is."""

    kind: Literal["bouc-wen-piezo", "second-order", "rigid-axis", "cascaded-tanks"]
    parameters: dict[str, FiniteFloat] = Field(default_factory=dict, max_length=32)


class LinearSpec(_Spec):
    """A linear model, estimated from the part of the record that is not locked away.

    ``order`` poles and as many zeros; the input may act ``delay`` samples late. Or given: coefficients of
    u(k - delay), u(k - delay - 1), ..., of y(k-1), y(k-2), ..., and the output's level at rest.
    """

    kind: Literal["linear"]
    order: Annotated[int, Field(ge=0, le=10)]
    delay: Annotated[int, Field(ge=0, le=1000)] = 0
    numerator: tuple[FiniteFloat, ...] | None = Field(default=None, max_length=11)
    denominator: tuple[FiniteFloat, ...] = Field(default=(), max_length=10)
    level: FiniteFloat = 0.0

    @model_validator(mode="after")
    def _complete(self) -> "LinearSpec":
        if self.numerator is not None and (len(self.numerator), len(self.denominator)) != (
            self.order + 1,
            self.order,
        ):
            raise ValueError(f"order {self.order} takes {self.order + 1} and {self.order} coefficients")
        return self


class ProgramSpec(_Spec):
    """A Python function of the user's own: on the command line alone, since it is run here."""

    kind: Literal["python"]
    path: str
    function: str
    parameters: dict[str, FiniteFloat] = Field(default_factory=dict, max_length=64)


class ModelSpec(_Spec):
    """An identified model: what a model file holds."""

    kind: Literal["model"]
    model: dict[str, Any]
    name: str = Field(default="model", max_length=200)


class ColumnSpec(_Spec):
    """A column of the record: the output as somebody else's simulation has it."""

    kind: Literal["column"]
    column: Annotated[str, Field(min_length=1, max_length=200)]


class ValueSpec(_Spec):
    """A value of an effect."""

    value: FiniteFloat
    unit: str = ""


class EffectSpec(_Spec):
    """An effect with its values."""

    name: str
    site: str = ""
    parameters: dict[str, ValueSpec]


class FrameSpec(_Spec):
    """The coordinate that forces act on."""

    unit: str
    peak: PositiveFloat
    rate: PositiveFloat
    force_unit: str
    force: PositiveFloat
    sense: FiniteFloat
    dissipates: bool
    sharp: PositiveFloat


class ScalesSpec(_Spec):
    """The record that effects were found in: some of their values are parts of its peaks or its duration."""

    dt: PositiveFloat
    input_peak: PositiveFloat
    output_peak: PositiveFloat
    fitted_s: PositiveFloat
    duration_s: PositiveFloat
    frame: FrameSpec


class ExtendedSpec(_Spec):
    """A simulation with effects in it, as a diagnosis writes it."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True, serialize_by_alias=True)

    kind: Literal["extended"] = "extended"
    schema_version: Annotated[Literal["islands.extended/1"], Field(alias="schema")] = EXTENDED_SCHEMA
    inputs: tuple[str, ...]
    output: str
    core: "SimulationSpec"
    hold: Literal["first-order", "zero-order", "band-limited"] = "first-order"
    times: Annotated[int, Field(ge=1, le=64)] = 1
    effects: tuple[EffectSpec, ...]
    scales: ScalesSpec


class LocalExtendedSpec(ExtendedSpec):
    """The same; the simulation may be a program of the user's own."""

    core: "LocalSpec"  # type: ignore[assignment]


def innermost(spec: "SimulationSpec | LocalSpec") -> "SimulationSpec | LocalSpec":
    """Return the simulation that has no effects in it."""
    while isinstance(spec, ExtendedSpec):
        spec = spec.core
    return spec


#: What may be asked for over REST.
SimulationSpec: TypeAlias = Annotated[
    PhysicalSpec | LinearSpec | ModelSpec | ColumnSpec | ExtendedSpec, Field(discriminator="kind")
]

#: What may be asked for here.
LocalSpec: TypeAlias = Annotated[
    PhysicalSpec | LinearSpec | ModelSpec | ColumnSpec | LocalExtendedSpec | ProgramSpec,
    Field(discriminator="kind"),
]
ExtendedSpec.model_rebuild()
LocalExtendedSpec.model_rebuild()


@dataclass(frozen=True, slots=True)
class SimulatorKind:
    """A kind of simulator that can be specified on the command line.

    Attributes
    ----------
    argument : str
        What follows the name; brackets are optional parts.
    summary : str
    estimated : str
        What is estimated from the record unless it is given; empty if nothing is.
    """

    argument: str
    summary: str
    estimated: str = ""


#: Kinds of simulators by the name that their text on the command line begins with.
KINDS: Mapping[str, SimulatorKind] = MappingProxyType(
    {
        "bouc-wen-piezo": SimulatorKind(
            "[:FILE.json]",
            "Piezoelectric actuator: y = dp u - h, h' = A u' - beta |u'| h - gamma u' |h|. Parameters that "
            "are not given have the values of the paper",
        ),
        "second-order": SimulatorKind(
            "[:FILE.json]",
            "Oscillator: m x'' + c x' + k x = u, y = x",
            "m, c, k; position and rate at the first sample",
        ),
        "rigid-axis": SimulatorKind(
            "[:FILE.json]",
            "Axis with friction: m x'' + c x' + F tanh(x' / vs) = u, y = x. It restarts every half second "
            "from a state fitted to the measured output (multiple shooting), because its free run drifts",
            "m, c, F, vs",
        ),
        "cascaded-tanks": SimulatorKind(
            "[:FILE.json]",
            "Two tanks: x1' = k3 u - k1 sqrt(x1), x2' = k1 sqrt(x1) - k2 sqrt(x2), y = x2",
            "k1, k2, k3; both levels at the first sample",
        ),
        "linear": SimulatorKind(
            ":ORDER[:DELAY]",
            "Linear model of order 0 to 10, with as many zeros as poles; the input acts DELAY samples late",
            "all coefficients, the level and the initial state",
        ),
        "model": SimulatorKind(
            ":FILE.json",
            "Identified model with one input, in free run; or an extended simulation (`extended.json`)",
            "all parameters except those of terms that are linear in the output alone",
        ),
        "column": SimulatorKind(
            ":NAME",
            "Column of the record: the output of another simulation. Effects on its input or in its equation "
            "cannot be searched for",
        ),
        "python": SimulatorKind(
            ":FILE.py:FUNCTION",
            "Function `(u, dt, **parameters)` that returns the output; arguments with a number as default "
            "are parameters. The file is executed, so REST does not accept it",
            "its parameters",
        ),
    }
)


def parse_spec(text: str) -> LocalSpec:
    """Read what the command line asks for: a name, and behind a colon what it needs.

    Raises
    ------
    SettingsError, ModelError
        The text asks for nothing that there is, or names a file that cannot be read.
    """
    kind, _, rest = text.partition(":")
    try:
        match kind:
            case "model":
                document = _object(rest, ModelError)
                if document.get("schema") == EXTENDED_SCHEMA:
                    return LocalExtendedSpec.model_validate(document)
                return ModelSpec(kind=kind, model=document, name=f"model {Path(rest).name}")
            case "linear":
                order, _, delay = rest.partition(":")
                return LinearSpec(kind=kind, order=order, delay=delay or 0)  # type: ignore[arg-type]
            case "python":
                path, _, function = rest.rpartition(":")
                return ProgramSpec(kind=kind, path=path, function=function)
            case "column":
                return ColumnSpec(kind=kind, column=rest)
            case "bouc-wen-piezo" | "second-order" | "rigid-axis" | "cascaded-tanks":
                return PhysicalSpec(kind=kind, parameters=_object(rest, SettingsError) if rest else {})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise SettingsError(f"{text}: {where}: {first['msg']}") from error
    raise SettingsError(f"unknown simulation {kind!r}: take one of {', '.join(KINDS)}")


def is_extended(path: str) -> bool:
    """Tell whether a file holds an extended simulation; one that cannot be read does not."""
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and found.get("schema") == EXTENDED_SCHEMA


def _object(path: str, failure: type[ModelError] | type[SettingsError]) -> dict[str, Any]:
    """Read a file that holds a JSON object."""
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise failure(f"{path} cannot be read as JSON ({error}): give a file with an object") from error
    if not isinstance(found, dict):
        raise failure(f"{path} holds no JSON object: write one like {{...}}")
    return found
