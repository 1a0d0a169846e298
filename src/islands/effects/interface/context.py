"""Input of a simulation, scales of its record, and parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.records.channel_names import simplify_unit
from islands.records.segments import find_bounds, map_segments

Signal = NDArray[np.float64]

#: Starting points of a calibration, each with a value for every parameter.
Points = tuple[tuple[float, ...], ...]

#: Half width of a line in the spectrum, relative to the resolution.
LINE_WIDTH = 2.0

#: Least number of periods of an input in the estimation part, so that there is space between its harmonics.
MIN_PERIODS = 8

#: Fraction of the power of the input in its largest line, from which it has one frequency only.
MIN_LINE_POWER = 0.8


@dataclass(frozen=True, slots=True)
class ForceCoordinate:
    """Coordinate that forces act on.

    Attributes
    ----------
    unit : str
        Unit of the coordinate.
    peak : float
        Largest absolute value of the coordinate.
    rate : float
        Typical rate of the coordinate, per second.
    force_unit : str
        Unit of a force.
    force : float
        Peak of the signal that forces are added to: the output, or the input if forces move the coordinate.
    sign : float
        Sign of friction that is added to an output: -1 if the output follows the coordinate, 1 if the output
        is the force.
    is_dissipative : bool
        Whether strengths of friction and hysteresis are bounded below by zero.
    friction_smoothing : float
        Width of the smoothed sign change of dry friction, relative to the typical rate.
    is_output : bool
        Whether the output is the coordinate.
    """

    unit: str
    peak: float
    rate: float
    force_unit: str
    force: float
    sign: float = -1.0
    is_dissipative: bool = False
    friction_smoothing: float = 0.005
    is_output: bool = False

    @property
    def lower_bound(self) -> float:
        """Lower bound of the strength of friction and hysteresis."""
        return 0.0 if self.is_dissipative else -np.inf


@dataclass(frozen=True, slots=True, eq=False)
class SimulationContext:
    """Input of a simulation, and the scales of the record that it is compared with.

    Attributes
    ----------
    u : ndarray, shape (samples,)
        Input.
    dt : float
        Sampling time in seconds.
    channels : mapping
        Other measured signals by name, each (samples,).
    units : mapping
        Units of the channels.
    input_peak, output_peak : float
        Largest absolute values of the input and of the output of the nominal simulation.
    input_unit, output_unit : str
    fit_end_time : float
        End of the estimation part, in seconds after the first sample.
    intersample_values : ndarray, shape (2, samples), or None
        Input half a step and a full step after each sample; at a discontinuity the left limit. None if the
        input is linear between samples.
    reference_duration : float or None
        Reference duration in seconds for strengths over the whole record; None for the duration of the input.
    force_coordinate : ForceCoordinate
        Coordinate that forces act on. By default it is the input, and forces are added to the output.
    segments : tuple of int
        Lengths of the recordings that the signals consist of, in samples; empty for a single one. A
        simulator receives the context of one recording.
    start_time : float
        Time of the first sample. A record starts at zero, and time runs on from one recording to the next
        without a pause, since a drift, a jump or a change of the system outlasts a recording.
    measured : ndarray, shape (samples of all recordings,), or None
        Output in the record, without gaps. None for a simulation without a record.
    whole : SimulationContext or None
        Context of all recordings, if this is the context of one of several.
    step_width : float
        Width of steps over time in samples; they are smoothed so that their instants have derivatives.
    intervals : ndarray, shape (values,), or None
        Seconds before each value of the signal of a map that has values between samples, zero for the second
        one of an instant; None if its values are ``dt`` apart.
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
    segments: tuple[int, ...] = ()
    start_time: float = 0.0
    measured: Signal | None = None
    whole: "SimulationContext | None" = None
    step_width: float = 2.0
    intervals: Signal | None = None

    def __post_init__(self) -> None:
        if self.force_coordinate is None:
            rate = float(np.std(self.take_differences(self.u))) / self.dt or 1.0
            coordinate = ForceCoordinate(
                self.input_unit, self.input_peak, rate, self.output_unit, self.output_peak
            )
            object.__setattr__(self, "force_coordinate", coordinate)

    @property
    def time(self) -> Signal:
        """Seconds since the first sample of the record, shape (samples,)."""
        return self.start_time + self.dt * np.arange(self.u.size, dtype=np.float64)

    @property
    def fitted_output(self) -> Signal | None:
        """Measured output of the estimation part, without gaps; None for a simulation without a record."""
        return None if self.measured is None else self.measured[: round(self.fit_end_time / self.dt)]

    @property
    def bounds(self) -> tuple[tuple[int, int], ...]:
        """First sample of every recording and the sample after its last."""
        return find_bounds(self.segments, self.u.size)

    @property
    def has_resting_input(self) -> bool:
        """Whether the input is constant over the estimation part."""
        whole = self.whole or self
        return bool(np.ptp(whole.u[: round(self.fit_end_time / self.dt)]) == 0.0)

    def split(self) -> "tuple[SimulationContext, ...]":
        """Return the context of each recording; scales, units and durations are those of the whole record."""
        if len(self.bounds) <= 1:
            return (self,)
        between = self.intersample_values
        return tuple(
            replace(
                self,
                u=self.u[first:last],
                channels={name: signal[first:last] for name, signal in self.channels.items()},
                intersample_values=None if between is None else between[:, first:last],
                reference_duration=self.duration,
                segments=(),
                start_time=self.start_time + self.dt * first,
                whole=self,
            )
            for first, last in self.bounds
        )

    def take_differences(self, signal: Signal) -> Signal:
        """Return the differences of successive samples within the recordings."""
        return map_segments(np.diff, signal, self.segments)

    def get_intersample_values(self, x: Signal) -> Signal:
        """Return ``intersample_values``, or those of linear interpolation of the input ``x`` if None."""
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
    """Parameter of a simulator or of an effect.

    Attributes
    ----------
    name : str
    unit : str
        Empty if dimensionless.
    nominal : float
        Initial value in the calibration of a simulator; value at which an effect vanishes.
    scale : float
        Typical change; finite differences take a hundredth of it.
    lower, upper : float
        Bounds.
    initial : bool
        Whether the parameter is an initial state, which belongs to the record and not to the simulator.
    is_positive : bool
        Whether only positive values are physically possible, as of a mass. A calibrated value may be negative
        if the record requires it.
    """

    name: str
    unit: str
    nominal: float
    scale: float
    lower: float = -inf
    upper: float = inf
    initial: bool = False
    is_positive: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", simplify_unit(self.unit))


def compute_spectrum(signal: Signal) -> NDArray[np.floating[Any]]:
    """Return the spectrum of a signal; zero padding resolves frequencies between its bins."""
    return np.abs(np.fft.rfft(signal * np.hanning(signal.size), 4 * signal.size))


def find_single_frequency(context: SimulationContext) -> float | None:
    """Return the frequency in Hz of an input with a single line in its spectrum, otherwise None."""
    resolution = 1.0 / context.fit_end_time
    u = context.u[: int(context.fit_end_time / context.dt)]
    spectrum = compute_spectrum(u - u.mean()) ** 2
    frequencies = np.fft.rfftfreq(4 * u.size, context.dt)
    line = float(frequencies[np.argmax(spectrum)])
    is_near = np.abs(frequencies - line) < LINE_WIDTH * resolution
    is_resolved = line >= MIN_PERIODS * resolution
    return line if is_resolved and spectrum[is_near].sum() >= MIN_LINE_POWER * spectrum.sum() else None
