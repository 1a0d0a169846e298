"""Misfit of the best linear simulation, by a fit that shares no code with the analysis."""

from collections.abc import Callable

import numpy as np
import scipy

from lab.diagnosis.injection.excitation import Signal
from lab.diagnosis.injection.unusual.integration import MACHINE_DT, PROCESS_DT

#: Largest natural logarithm of a parameter relative to its start, so that a fit cannot overflow.
_RANGE = 4.0


def compute_misfit(simulation: str, u: Signal, y: Signal) -> float:
    """Return the RMS deviation of the best simulation of a kind from an output, from rest.

    Parameters
    ----------
    simulation : str
        ``second-order``, or ``linear:`` and an order.
    u, y : ndarray, shape (samples,)
        Input that drives the simulation, and the output without noise.
    """
    if simulation == "second-order":
        return _fit_oscillator(u, y)
    return _fit_process(u, y, int(simulation.partition(":")[2]))


def _fit_oscillator(u: Signal, y: Signal) -> float:
    """Fit natural frequency and damping; the gain is a linear least-squares problem."""

    def compute_residual(point: Signal) -> Signal:
        frequency, damping = np.exp(point)
        return _project_out(y, _respond(u, [1.0, 2 * damping * frequency, frequency**2], MACHINE_DT))

    return _minimise(compute_residual, np.log([50.0, 0.1]))


def _fit_process(u: Signal, y: Signal, order: int) -> float:
    """Fit time constants; coefficients of the input and a level are a linear least-squares problem.

    The output is a linear combination of the low-passes of the input, with the input itself and a constant.
    """

    def compute_residual(point: Signal) -> Signal:
        poles = np.exp(-PROCESS_DT / np.exp(point))
        columns = [np.ones_like(u), u]
        columns += [scipy.signal.lfilter([0.0, 1.0 - pole], [1.0, -pole], u) for pole in poles]
        return _project_out(y, np.column_stack(columns))

    return _minimise(compute_residual, np.log([2.0, 0.7][:order]))


def _respond(u: Signal, denominator: list[float], dt: float) -> Signal:
    """Return the response to an input that is linear between samples, as a column."""
    numerator, poles, _ = scipy.signal.cont2discrete(([1.0], denominator), dt, method="foh")
    return scipy.signal.lfilter(np.ravel(numerator), poles, u)[:, None]


def _project_out(y: Signal, columns: Signal) -> Signal:
    columns = columns / np.linalg.norm(columns, axis=0)
    return y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]


def _minimise(compute_residual: Callable[[Signal], Signal], start: Signal) -> float:
    found = scipy.optimize.least_squares(
        compute_residual, start, bounds=(start - _RANGE, start + _RANGE), x_scale=0.1
    )
    return float(np.sqrt(np.mean(found.fun**2)))
