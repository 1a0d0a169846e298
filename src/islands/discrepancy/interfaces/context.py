"""Simulation context: the input of a simulation, and the scales of its record."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

Signal = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ForceCoordinate:
    """Coordinate that forces act on.

    Attributes
    ----------
    unit, peak : str, float
        Of the coordinate.
    rate : float
        Its usual rate, per second.
    force_unit, force : str, float
        Unit and size of what acts on it.
    sign : float
        Sign of friction that is added to an output: -1 if the output follows the coordinate, 1 if the output
        is the force.
    is_dissipative : bool
        Whether strengths of friction and hysteresis are bounded below by zero.
    friction_smoothing : float
        Width of the transition of dry friction relative to the usual rate; a step has no derivative.
    """

    unit: str
    peak: float
    rate: float
    force_unit: str
    force: float
    sign: float = -1.0
    is_dissipative: bool = False
    friction_smoothing: float = 0.005

    @property
    def lower_bound(self) -> float:
        """Lower bound of a strength that can only dissipate."""
        return 0.0 if self.is_dissipative else -np.inf


@dataclass(frozen=True, slots=True, eq=False)
class SimulationContext:
    """Input of a simulation, and the scales of the record that it is compared with.

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
    fit_end_time : float
        End of the estimation part, in seconds after the first sample.
    intersample_values : ndarray, shape (2, samples), or None
        The input half a step and a full step after each sample, before a jump; None if it is linear between
        samples.
    reference_duration : float or None
        Reference duration in seconds for strengths over the whole record; None for the duration of the input.
    force_coordinate : ForceCoordinate
        Coordinate that forces act on; by default the input, and forces are added to the output.
    """

    u: Signal
    dt: float
    channels: Mapping[str, Signal]
    units: Mapping[str, str]
    input_peak: float
    output_peak: float
    input_unit: str
    output_unit: str
    fit_end_time: float
    intersample_values: Signal | None = None
    reference_duration: float | None = None
    force_coordinate: ForceCoordinate = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.force_coordinate is None:
            rate = float(np.std(np.diff(self.u))) / self.dt or 1.0
            coordinate = ForceCoordinate(
                self.input_unit, self.input_peak, rate, self.output_unit, self.output_peak
            )
            object.__setattr__(self, "force_coordinate", coordinate)

    @property
    def time(self) -> Signal:
        """Seconds since the first sample, shape (samples,)."""
        return self.dt * np.arange(self.u.size, dtype=np.float64)

    def get_intersample_values(self, x: Signal) -> Signal:
        """Return ``midway``, or linear interpolation of the input ``x`` if that is None."""
        if self.intersample_values is not None:
            return self.intersample_values
        end = np.append(x[1:], x[-1])
        return np.stack([(x + end) / 2, end])

    @property
    def duration(self) -> float:
        """Duration of the record in seconds."""
        return self.dt * self.u.size if self.reference_duration is None else self.reference_duration


@dataclass(frozen=True, slots=True)
class Parameter:
    """A physical quantity.

    Attributes
    ----------
    name : str
    unit : str
        Empty if dimensionless.
    nominal : float
        Starting value of a parameter of a simulator; value at which an effect vanishes.
    scale : float
        Typical change; finite differences take a hundredth of it.
    lower, upper : float
        Bounds.
    initial : bool
        Whether it is an initial state, which belongs to the record and not to the simulator.
    """

    name: str
    unit: str
    nominal: float
    scale: float
    lower: float = -inf
    upper: float = inf
    initial: bool = False
