"""An effect: something that a simulation may lack, with its form, its place and its strengths."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from islands.discrepancy.parameter import Parameter

Signal = NDArray[np.float64]


class Site(StrEnum):
    """Where an effect enters."""

    INPUT = "input map"
    FORCE = "coordinate and rate"
    CORE = "state equation"
    PARAMETER = "parameter"
    OUTPUT = "output map"


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What a simulation is driven by, and the scales of the record that it is held against.

    Attributes
    ----------
    u : ndarray, shape (samples,)
        The input.
    dt : float
        Sampling time in seconds; times of changes count from the first sample.
    channels : mapping
        Other measured signals by name, each (samples,).
    units : mapping
        Their units.
    input_peak, output_peak : float
        Largest absolute values; of the output as the nominal simulation has it.
    input_unit, output_unit : str
    fitted : float
        Seconds, from the first sample on, that estimation sees.
    """

    u: Signal
    dt: float
    channels: Mapping[str, Signal]
    units: Mapping[str, str]
    input_peak: float
    output_peak: float
    input_unit: str
    output_unit: str
    fitted: float

    @property
    def time(self) -> Signal:
        """Seconds since the first sample, shape (samples,)."""
        return self.dt * np.arange(self.u.size, dtype=np.float64)

    @property
    def duration(self) -> float:
        """Seconds of the whole record."""
        return self.dt * self.u.size


#: ``(signal, values, scene) -> signal`` for maps, ``(coordinate, rate, values, scene) -> force`` for forces.
Form = Callable[..., Signal]


@dataclass(frozen=True, slots=True)
class Effect:
    """An entry of the catalogue.

    Attributes
    ----------
    name, family : str
    site : Site
    parameters : callable
        ``scene -> tuple of Parameter``: strength first, then shape.
    grid : callable
        ``(scene, residual) -> points``: values that a search begins from; the residual is that of the
        simulation as it stands.
    form : callable or None
        What it does, by its site. None: the simulation's own equation has its parameters, by their names.
    source : str
        Where its form is described.
    applies : callable
        ``scene -> bool``: whether the record could show it at all.
    linear : int
        How many of its parameters, from the first on, its response is proportional to.
    gain : bool
        It is a gain: calibration takes it up, unless every parameter has a tolerance.
    searched : int
        What it costs beside its values, in values: an instant or a frequency is known to a sample, and was
        looked for among all of them.
    """

    name: str
    family: str
    site: Site
    parameters: Callable[[Scene], tuple[Parameter, ...]]
    grid: Callable[[Scene, Signal], Sequence[tuple[float, ...]]]
    form: Form | None
    source: str
    applies: Callable[[Scene], bool] = lambda _: True
    linear: int = 1
    gain: bool = False
    searched: int = 0
