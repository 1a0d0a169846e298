"""Starts of linear models: a high-order ARX model, and a grid of poles.

An ARX model of high order is consistent for any noise and in closed loop. Of a transient, such as one step,
it is not determined; the grid covers the time constants and frequencies that the record can show.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from islands.estimation.linear.sections import BLOCK, Signal, Signals

#: Lags of the output of the ARX model, and samples for each of its parameters.
_LAGS, _SAMPLES_PER_PARAMETER = 40, 4

#: Part of the largest singular value below which a sum of squares has lost the others.
_PRECISION = 1e-6

#: Standard errors from which a coefficient ends the dead time.
_SIGNIFICANT = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class HighOrder:
    """High-order ARX model.

    Attributes
    ----------
    delays : ndarray of int64, shape (outputs, inputs)
        Samples before the first significant coefficient, less one; not less than 0.
    leads : ndarray of bool, shape (outputs, inputs)
        Whether the first significant coefficient is that of the same sample.
    polynomials : list of (tuple of ndarray)
        Of every output: the denominator, the numerators of the inputs from lag 0 on, shape (inputs, lags),
        and the variance of the error.
    """

    delays: NDArray[np.int64]
    leads: NDArray[np.bool_]
    polynomials: list[tuple[Signal, Signal, float]]


def fit_high_order(signals: Signals, largest_delay: int, feedthrough: bool = False) -> HighOrder | None:
    """Fit the ARX model; None if the samples do not determine it.

    Parameters
    ----------
    signals : Signals
    largest_delay : int
    feedthrough : bool
        Whether an output reads the inputs of the same sample. Poles of a model without them are wrong if the
        process has a direct path.
    """
    inputs, outputs = len(signals.u), len(signals.y)
    share = signals.samples // (_SAMPLES_PER_PARAMETER * (1 + inputs))
    lags = min(_LAGS, share)
    reach = min(lags + largest_delay, share)
    if lags < 2:
        return None
    direct, polynomials = int(feedthrough), list[tuple[Signal, Signal, float]]()
    first, delays = (np.zeros((outputs, inputs), np.int64) for _ in range(2))
    for output in range(outputs):
        factor = _triangulate(signals, output, lags, reach, direct)
        count = lags + inputs * reach + 1
        norms = np.linalg.norm(factor[:, :count], axis=0)
        norms[norms == 0.0] = 1.0
        u, s, vt = np.linalg.svd(factor[:, :count] / norms)
        kept = s > _PRECISION * s[0]
        moment = (u.T @ factor[:, count])[:count]
        theta = (vt[kept].T @ (moment[kept] / s[kept])) / norms
        rest = factor[:, count] - factor[:, :count] @ theta
        variance = float(rest @ rest) / max(1, signals.samples - count)
        errors = np.sqrt(variance * np.sum((vt[kept] / s[kept, None]) ** 2, axis=0)) / norms
        numerators = theta[lags:-1].reshape(inputs, reach)
        significant = np.abs(numerators) > _SIGNIFICANT * errors[lags:-1].reshape(inputs, reach)
        first[output] = np.where(significant.any(axis=1), significant.argmax(axis=1), direct)
        delays[output] = np.clip(first[output] - direct, 0, largest_delay)
        numerators = np.hstack([np.zeros((inputs, 1 - direct)), numerators])
        polynomials.append((np.append(1.0, -theta[:lags]), numerators, variance))
    return HighOrder(delays, first < direct, polynomials)


def _triangulate(signals: Signals, output: int, lags: int, reach: int, direct: int) -> Signal:
    """Return the triangular factor of lagged outputs and inputs, a constant and the output.

    Inputs begin with the same sample if ``direct`` is 1, with the sample before if it is 0.
    """
    first, parts = max(lags, reach), []
    for begin, end in signals.bounds:
        for at in range(begin + first, end, BLOCK):
            last = min(at + BLOCK, end)
            rows = [sliding_window_view(signals.y[output, at - lags : last - 1], lags)[:, ::-1]]
            inputs = signals.u[:, at - reach + direct : last - 1 + direct]
            rows += [sliding_window_view(u, reach)[:, ::-1] for u in inputs]
            rows += [np.ones((last - at, 1)), signals.y[output, at:last, None]]
            parts.append(np.hstack(rows))
    size = parts[0].shape[1] if parts else 0
    gram = sum(part.T @ part for part in parts)
    values, vectors = np.linalg.eigh(gram)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T) if size else np.zeros((0, 0))


def grid_real(samples: int, count: int = 8) -> list[Signal]:
    """Return single real poles of time constants up to the length of the record."""
    return [np.array([np.exp(-1.0 / t)]) for t in np.geomspace(0.7, max(samples / 2.0, 4.0), count)]


def grid_pairs(samples: int) -> list[NDArray[np.complex128]]:
    """Return complex pairs from a period of the length of the record."""
    found = []
    for damping in (0.03, 0.15, 0.5):
        for frequency in np.geomspace(2.0 * np.pi * 1.5 / samples, 2.8, 16):
            pole = np.exp(frequency * (-damping + 1j * np.sqrt(1.0 - damping**2)))
            found.append(np.array([pole, np.conj(pole)]))
    return found
