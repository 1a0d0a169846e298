"""Parts of specifications: base classes, effects of an extended simulation, and the type of a table entry."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, FiniteFloat, PositiveFloat

from islands.errors import ModelError, SettingsError


class SpecModel(BaseModel):
    """Base class of all parts of a specification: immutable, without unknown fields."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class ValueSpec(SpecModel):
    """Value of a parameter of an effect."""

    value: FiniteFloat
    unit: str = ""


class EffectSpec(SpecModel):
    """An effect and the values of its parameters."""

    name: str
    site: str = ""
    parameters: dict[str, ValueSpec]


class FrameSpec(SpecModel):
    """Coordinate that forces act on."""

    unit: str
    peak: PositiveFloat
    rate: PositiveFloat
    force_unit: str
    force: PositiveFloat
    sense: FiniteFloat
    dissipates: bool
    sharp: PositiveFloat


class ScalesSpec(SpecModel):
    """Scales of the record in which the effects were found; some of their values are relative to these."""

    dt: PositiveFloat
    input_peak: PositiveFloat
    output_peak: PositiveFloat
    fitted_s: PositiveFloat
    duration_s: PositiveFloat
    frame: FrameSpec
    step_width: PositiveFloat = 2.0


class SignalRangeSpec(SpecModel):
    """Range and largest rate per second of a signal, in which an extended simulation was tested."""

    name: str
    unit: str
    low: FiniteFloat
    high: FiniteFloat
    rate: FiniteFloat


class SimulatorSpec(SpecModel):
    """Base class of the specifications in the table of simulators."""

    @classmethod
    def from_text(cls, kind: str, text: str) -> Any:
        """Parse the ``text`` that follows ``kind:`` on the command line."""
        raise NotImplementedError


class ParameterRange(StrEnum):
    """Values that a parameter of a physical system can have."""

    REAL = "any"
    NONNEGATIVE = "zero or positive"
    POSITIVE = "positive"


@dataclass(frozen=True, slots=True)
class SimulatorEntry:
    """Entry of the table of simulators.

    Attributes
    ----------
    name : str
        Name on the command line, and ``kind`` of the specification.
    argument : str
        Text that follows the name on the command line; brackets are optional parts.
    summary : str
        Description for the reference, without a final period.
    spec : type
        Pydantic model of the specification.
    factory : str
        ``module:function``, imported when the first simulator is made, since it needs the kernels. It takes
        the specification, the record and the columns of the record's file.
    parameters : mapping
        Parameters of a physical system that can be given, and their ranges.
    estimated : str
        What is estimated from the record unless it is given; empty if nothing is.
    is_remote : bool
        Whether REST accepts the simulator.
    estimator : str
        ``module:function`` that estimates the parameters of a physical system that are not given, from its
        equations, the given parameters and the estimation part of the record; empty if nothing is estimated.
    """

    name: str
    argument: str
    summary: str
    spec: type[SimulatorSpec]
    factory: str
    parameters: Mapping[str, ParameterRange] = field(default_factory=dict)
    estimated: str = ""
    is_remote: bool = True
    estimator: str = ""


def read_object(path: str, failure: type[ModelError] | type[SettingsError]) -> dict[str, Any]:
    """Read a file that holds a JSON object."""
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise failure(f"{path} cannot be read as JSON ({error}): give a file with an object") from error
    if not isinstance(found, dict):
        raise failure(f"{path} does not hold a JSON object: write one like {{...}}")
    return found
