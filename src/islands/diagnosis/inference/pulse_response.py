"""Linear response of a simulation to its input: the response to a pulse, and signals filtered by it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.gross_errors.closed_loop import PULSE
from islands.effects.interface.context import Signal
from islands.records.segments import map_segments


def respond_to_pulse(fit: CalibrationResult) -> Signal | None:
    """Return the response of a simulation to a pulse of one; None if there is none, or if it diverges.

    The output of another program does not respond: functions of the input are added to it.
    """
    simulation, context = fit.simulation, fit.simulation.context
    if simulation.simulator.is_recorded:
        return np.ones(1)
    first, last = max(context.bounds, key=lambda bounds: bounds[1] - bounds[0])
    middle, size = (first + last) // 2, PULSE * context.input_peak
    outputs = []
    # A hysteresis does not return after a pulse: what remains has the same sign after the opposite one.
    for change in (size, -size):
        u = context.u.copy()
        u[middle] += change
        outputs.append(replace(simulation, context=replace(context, u=u)).simulate(fit.values))
    response: Signal = ((outputs[0] - outputs[1]) / (2.0 * size))[middle:last]
    return response if np.isfinite(response).all() and response.any() else None


def convolve(signal: Signal, response: Signal, segments: Sequence[int]) -> Signal:
    """Return a signal filtered by an impulse response; before each recording it has its first value."""

    def convolve(part: Signal) -> Signal:
        size = scipy.fft.next_fast_len(part.size + response.size - 1, real=True)
        spectrum = np.fft.rfft(part - part[0], size) * np.fft.rfft(response, size)
        return np.asarray(np.fft.irfft(spectrum, size)[: part.size] + part[0] * response.sum())

    return map_segments(convolve, signal, segments)
