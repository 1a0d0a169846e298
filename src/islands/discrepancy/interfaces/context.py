"""A scene: what drives a simulation, and the scales of the record that it is held against."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

Signal = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ForceCoordinate:
    """The coordinate that forces act on.

    Attributes
    ----------
    unit, peak : str, float
        Of the coordinate.
    rate : float
        Its usual rate, per second.
    force_unit, force : str, float
        Unit and size of what acts on it.
    sense : float
        With which friction enters an output beside the simulation: -1 where the output follows the
        coordinate, 1 where it is the force itself.
    dissipates : bool
        Friction and hysteresis take energy: their strengths are not negative.
    sharp : float
        Part of the usual rate within which dry friction turns: a step would have no derivative.
    """

    unit: str
    peak: float
    rate: float
    force_unit: str
    force: float
    sense: float = -1.0
    dissipates: bool = False
    sharp: float = 0.005

    @property
    def least(self) -> float:
        """The lower bound of what can only dissipate."""
        return 0.0 if self.dissipates else -np.inf


@dataclass(frozen=True, slots=True, eq=False)
class SimulationContext:
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
    midway : ndarray, shape (2, samples), or None
        The input half a step and a whole one behind each sample, before it may jump; None: it runs straight
        from sample to sample.
    lasts : float or None
        Seconds that strengths over the whole record refer to; None takes those of the input.
    frame : ForceCoordinate
        The coordinate that forces act on. Left out, it is the input, and forces add to the output.
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
    midway: Signal | None = None
    lasts: float | None = None
    frame: ForceCoordinate = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.frame is None:
            rate = float(np.std(np.diff(self.u))) / self.dt or 1.0
            frame = ForceCoordinate(
                self.input_unit, self.input_peak, rate, self.output_unit, self.output_peak
            )
            object.__setattr__(self, "frame", frame)

    @property
    def time(self) -> Signal:
        """Seconds since the first sample, shape (samples,)."""
        return self.dt * np.arange(self.u.size, dtype=np.float64)

    def midway_of(self, x: Signal) -> Signal:
        """Return ``midway``, where it is not known as the straight line through the input ``x``."""
        if self.midway is not None:
            return self.midway
        end = np.append(x[1:], x[-1])
        return np.stack([(x + end) / 2, end])

    @property
    def duration(self) -> float:
        """Seconds of the whole record."""
        return self.dt * self.u.size if self.lasts is None else self.lasts


@dataclass(frozen=True, slots=True)
class Parameter:
    """A physical quantity.

    Attributes
    ----------
    name : str
    unit : str
        "" where it has none.
    nominal : float
        A simulation's: where nothing else is known. An effect's: at which it does nothing.
    scale : float
        A change that matters: steps of derivatives are a hundredth of it.
    lower, upper : float
        Bounds.
    initial : bool
        It is a state at the first sample, and belongs to the record more than to the simulation.
    """

    name: str
    unit: str
    nominal: float
    scale: float
    lower: float = -inf
    upper: float = inf
    initial: bool = False
