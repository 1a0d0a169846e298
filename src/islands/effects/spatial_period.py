"""Effects that are periodic in the position: cogging of a motor, and the cyclic error of an encoder."""

from collections.abc import Mapping, Sequence
from itertools import product
from math import cos, pi, sin
from typing import Any

import numpy as np

from islands.effects.interface.context import Parameter, Points, Signal, SimulationContext
from islands.effects.interface.effect import Effect, ForceLaw, Formula, MapEquation, Site

#: Least number of periods of cogging within the range of the position; fewer are a static curve.
MIN_COGGING_PERIODS = 3

#: Least number of periods of a cyclic error. The free curve of the output has eight intervals, and the
#: error of such a curve has as many periods.
MIN_CYCLIC_PERIODS = 9

#: Number of bins over the range of the position.
BINS = 2048

#: Half width of a line in the spectrum of a record with the Hann window, in periods over the range.
LINE_WIDTH = 2.0

#: Wave over the position, in the values of an effect.
_WAVE = f"n0*cos({2 * pi}*n2*x) + n1*sin({2 * pi}*n2*x)"

#: Number of spatial frequencies of cogging that the calibration starts from, by the order of the differences
#: of the residual. The residual of a spring is proportional to the force, as is the second difference of a
#: mass's.
COGGING_LINES: Mapping[int, int] = {0: 2, 1: 1, 2: 2}

#: The same of a cyclic error, which is a part of the residual.
CYCLIC_LINES: Mapping[int, int] = {0: 2}


def _get_range(context: SimulationContext, peak: float) -> float:
    """Return the range of the measured position, or that of a symmetric one with a given peak."""
    # A saved simulation has the scales of the record, but not its output.
    return 2.0 * peak if context.measured is None else float(np.ptp(_take_fitted(context)))


def _take_fitted(context: SimulationContext) -> Signal:
    """Return the measured position in the estimation part."""
    measured = context.fitted_output
    assert measured is not None
    return measured


def _has_range(context: SimulationContext) -> bool:
    return context.measured is not None and float(np.ptp(_take_fitted(context))) > 0.0


def _list_parameters(
    span: float, unit: str, size: float, size_unit: str, periods: int
) -> tuple[Parameter, ...]:
    return (
        Parameter("cosine", size_unit, 0.0, 0.005 * size),
        Parameter("sine", size_unit, 0.0, 0.005 * size),
        Parameter("frequency", f"1/{unit}", 0.0, 0.1 / span, periods / span),
    )


def _compute_spatial_spectrum(x: Signal, residual: Signal) -> tuple[Signal, Signal]:
    """Return spatial frequencies and the spectrum of a residual over the position.

    The weight of the mean of a bin is the square root of its number of samples, so that a bin where the axis
    rests does not outweigh the others. The window suppresses the leakage of curves over the position.
    """
    bins = np.minimum((BINS * (x - x.min()) / np.ptp(x)).astype(np.intp), BINS - 1)
    counts = np.bincount(bins, minlength=BINS)
    sums = np.bincount(bins, residual - residual.mean(), BINS)
    means = sums / np.sqrt(np.maximum(counts, 1)) * np.hanning(BINS)
    frequencies = np.arange(2 * BINS + 1) / (4.0 * float(np.ptp(x)))
    spectrum: Signal = np.abs(np.fft.rfft(means, 4 * BINS))
    return frequencies, spectrum


def _take_differences(signal: Signal, order: int) -> Signal:
    """Return differences of a signal, which is smoothed over some samples since they amplify noise."""
    window = np.hanning(4 * order + 3)[1:-1]
    smooth = np.convolve(signal - signal.mean(), window / window.sum(), mode="same")
    return np.diff(smooth, order, prepend=np.zeros(order))


def _list_starting_points(
    positions: Sequence[Signal],
    residual: Signal,
    lines: Mapping[int, int],
    size: float,
    periods: int,
    highest: float,
) -> Points:
    """Return points with the frequencies of the largest lines in spectra over the position.

    Parameters
    ----------
    positions : sequence of ndarray, each of shape (samples,)
        Positions in the estimation part, the measured one first.
    lines : mapping
        Number of lines by the order of the differences of the residual.
    size : float
        Amplitude.
    periods : int
        Least number of periods within the range of the measured position.
    highest : float
        Highest spatial frequency.
    """
    span = float(np.ptp(positions[0]))
    if not span > 0.0:
        return ()
    found: list[float] = []
    moving = [x for x in positions if np.ptp(x) > 0.0]
    for x, (order, count) in product(moving, lines.items()):
        frequencies, spectrum = _compute_spatial_spectrum(x, _take_differences(residual[: x.size], order))
        spectrum[(frequencies < periods / span) | (frequencies > highest)] = 0.0
        for _ in range(count):
            for known in found:
                spectrum[np.abs(frequencies - known) < LINE_WIDTH / span] = 0.0
            if spectrum.any():
                found.append(float(frequencies[np.argmax(spectrum)]))
    return tuple(point for period in found for point in ((size, 0.0, period), (0.0, size, period)))


def _cogging_force(x: float, _rate: float, _z: float, k: Any) -> float:
    return k[0] * cos(2.0 * pi * k[2] * x) + k[1] * sin(2.0 * pi * k[2] * x)


def _cogging_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    coordinate = context.force_coordinate
    span = _get_range(context, coordinate.peak)
    return _list_parameters(
        span, coordinate.unit, coordinate.force, coordinate.force_unit, MIN_COGGING_PERIODS
    )


def _cogging_starting_points(context: SimulationContext, residual: Signal) -> Points:
    coordinate = context.force_coordinate
    # At its typical rate, the position passes at most one period in a sample.
    highest = 1.0 / max(coordinate.rate * context.dt, np.finfo(float).tiny)
    return _list_starting_points(
        [_take_fitted(context)],
        residual,
        COGGING_LINES,
        0.02 * coordinate.force,
        MIN_COGGING_PERIODS,
        highest,
    )


COGGING = Effect(
    name="cogging",
    title="force periodic in the position",
    summary="Force that is periodic in the position, as of magnets: + a cos(2 pi f x) + b sin(2 pi f x)",
    family="shape",
    site=Site.FORCE,
    parameters=_cogging_parameters,
    starting_points=_cogging_starting_points,
    form=ForceLaw(_cogging_force, equation=_WAVE),
    formula=Formula("a*cos(2*pi*f*x) + b*sin(2*pi*f*x)", symbols=("a", "b", "f")),
    source="Jahns and Soong, Pulsating torque minimization techniques for AC motor drives, 1996",
    is_applicable=lambda context: context.force_coordinate.is_output and _has_range(context),
    linear_parameters=2,
    extra_degrees_of_freedom=2,
    similar_to="coloured noise, periodic-disturbance at a constant speed, cyclic-error",
    distinguished_by="a line in the spectrum over the position; its frequency over time is that of the speed",
    occurs_in="motors with permanent magnets, gear teeth, lead screws, unbalance",
)


def _cyclic_error_form(y: Signal, values: Signal, _context: SimulationContext) -> Signal:
    phase = 2.0 * pi * values[2] * y
    return y + values[0] * np.cos(phase) + values[1] * np.sin(phase)


def _cyclic_error_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    span = _get_range(context, context.output_peak)
    unit = context.output_unit
    return _list_parameters(span, unit, context.output_peak, unit, MIN_CYCLIC_PERIODS)


def _cyclic_error_starting_points(context: SimulationContext, residual: Signal) -> Points:
    measured = _take_fitted(context)
    # The position passes at most one period in a sample, or is known to within a radian of it.
    change = float(np.std(context.take_differences(measured)))
    error = 2.0 * pi * float(np.std(residual))
    highest = 1.0 / max(min(change, error), np.finfo(float).tiny)
    # The measured position contains the error, and the simulated one those of other causes.
    positions = measured, measured - residual[: measured.size]
    return _list_starting_points(
        positions, residual, CYCLIC_LINES, 0.002 * context.output_peak, MIN_CYCLIC_PERIODS, highest
    )


CYCLIC_ERROR = Effect(
    name="cyclic-error",
    title="cyclic error of the sensor",
    summary="Periodic error of an encoder or interferometer: y + a cos(2 pi f y) + b sin(2 pi f y)",
    family="shape",
    site=Site.OUTPUT,
    parameters=_cyclic_error_parameters,
    starting_points=_cyclic_error_starting_points,
    form=_cyclic_error_form,
    equation=lambda _: MapEquation(f"x + {_WAVE}"),
    formula=Formula("x + a*cos(2*pi*f*x) + b*sin(2*pi*f*x)", symbols=("a", "b", "f")),
    source="Birch, Optical fringe subdivision with nanometric accuracy, 1990",
    is_applicable=_has_range,
    linear_parameters=2,
    extra_degrees_of_freedom=2,
    similar_to="cogging, periodic-disturbance at a constant speed",
    distinguished_by="the same error at any speed; the motion due to a force is smaller at a higher speed",
    occurs_in="encoders and interferometers: interpolation and alignment",
)
