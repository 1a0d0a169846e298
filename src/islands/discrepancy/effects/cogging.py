"""Cogging: a force that is periodic in the position, as of a motor with magnets."""

from math import cos, pi, sin
from typing import Any

import numpy as np

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, ForceLaw, Signal, SimulationContext, Site

#: Least number of periods within the range of the coordinate; fewer are a static curve.
MIN_PERIODS = 3

#: Number of bins over the range of the coordinate.
BINS = 2048

#: Half width of a line in the spectrum of a record with the Hann window, in periods over the range.
LINE_WIDTH = 2.0

#: Number of spatial frequencies that the calibration starts from, by the order of the differences of the
#: residual. The residual of a spring is proportional to the force, as is the second difference of a mass's.
STARTING_FREQUENCIES = {0: 2, 1: 1, 2: 2}


def _cogging_force(x: float, _rate: float, _z: float, k: Any) -> float:
    return k[0] * cos(2.0 * pi * k[2] * x) + k[1] * sin(2.0 * pi * k[2] * x)


def _get_range(context: SimulationContext) -> float:
    """Return the range of the measured coordinate in the estimation part."""
    coordinate = context.force_coordinate.measured
    assert coordinate is not None
    return float(np.ptp(coordinate[: round(context.fit_end_time / context.dt)]))


def _cogging_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    coordinate = context.force_coordinate
    # A saved simulation has the scales of the record, but not its coordinate.
    span = 2.0 * coordinate.peak if coordinate.measured is None else _get_range(context)
    return (
        Parameter("cosine", coordinate.force_unit, 0.0, 0.005 * coordinate.force),
        Parameter("sine", coordinate.force_unit, 0.0, 0.005 * coordinate.force),
        Parameter("frequency", f"1/{coordinate.unit}", 0.0, 0.1 / span, MIN_PERIODS / span),
    )


def _compute_spatial_spectrum(x: Signal, residual: Signal) -> tuple[Signal, Signal]:
    """Return spatial frequencies and the spectrum of a residual over the coordinate.

    The weight of the mean of a bin is the square root of its number of samples, so that a bin where the axis
    rests does not outweigh the others. The window suppresses the leakage of curves over the coordinate.
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


def _cogging_starting_points(context: SimulationContext, residual: Signal) -> tuple[tuple[float, ...], ...]:
    fitted = round(context.fit_end_time / context.dt)
    coordinate, span = context.force_coordinate, _get_range(context)
    assert coordinate.measured is not None
    found: list[float] = []
    for order, count in STARTING_FREQUENCIES.items():
        differences = _take_differences(residual[:fitted], order)
        frequencies, spectrum = _compute_spatial_spectrum(coordinate.measured[:fitted], differences)
        # At its typical rate, the coordinate passes at most one period in a sample.
        is_resolved = frequencies * coordinate.rate * context.dt <= 1.0
        spectrum[(frequencies < MIN_PERIODS / span) | ~is_resolved] = 0.0
        for _ in range(count):
            for known in found:
                spectrum[np.abs(frequencies - known) < LINE_WIDTH / span] = 0.0
            if spectrum.any():
                found.append(float(frequencies[np.argmax(spectrum)]))
    force = 0.02 * coordinate.force
    return tuple(point for each in found for point in ((force, 0.0, each), (0.0, force, each)))


def _has_range(context: SimulationContext) -> bool:
    return context.force_coordinate.measured is not None and _get_range(context) > 0.0


COGGING = Effect(
    name="cogging",
    summary="Force that is periodic in the position, as of magnets: + a cos(2 pi f x) + b sin(2 pi f x)",
    family="shape",
    site=Site.FORCE,
    parameters=_cogging_parameters,
    starting_points=_cogging_starting_points,
    form=ForceLaw(_cogging_force, equation=f"n0*cos({2 * pi}*n2*x) + n1*sin({2 * pi}*n2*x)"),
    source="Jahns and Soong, Pulsating torque minimization techniques for AC motor drives, 1996",
    is_applicable=_has_range,
    linear_parameters=2,
    extra_degrees_of_freedom=2,
    similar_to="coloured noise, periodic-disturbance at a constant speed",
    distinguished_by="a line in the spectrum over the position; its frequency over time is that of the speed",
)
