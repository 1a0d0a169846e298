"""Initial poles and dead times of linear models: a high-order ARX model with Hankel reduction, and a grid.

An ARX model of high order is consistent for any noise and in closed loop. The singular vectors of the Hankel
matrix of its impulse response have the poles of every order (Ho and Kalman 1966; Kung 1978). Of a transient,
such as one step, ARX models are not determined; the grid covers the time constants and frequencies that the
record can show.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from islands.estimation.linear.sections import BLOCK, Signal, Signals
from islands.kernels.linear_filter import divide_rows

#: Lags of the output of the ARX model, samples for each of its parameters, and lags of the impulse response.
_LAGS, _SAMPLES_PER_PARAMETER, _RESPONSE = 40, 4, 240

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
    vectors : ndarray, shape (lags times outputs, orders)
        Left singular vectors of the Hankel matrix of the impulse responses.
    outputs : int
    """

    delays: NDArray[np.int64]
    leads: NDArray[np.bool_]
    vectors: Signal
    outputs: int

    def find_poles(self, order: int) -> NDArray[np.complex128]:
        """Return the stable poles of an order; those outside of the unit circle are reflected."""
        kept = self.vectors[:, :order]
        a = np.linalg.lstsq(kept[: -self.outputs], kept[self.outputs :], rcond=None)[0]
        poles = np.linalg.eigvals(a).astype(np.complex128)
        outside = np.abs(poles) >= 0.99999
        poles[outside] = 0.9999 * poles[outside] / np.abs(poles[outside])
        return poles


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
    direct, responses = int(feedthrough), []
    first, delays = (np.zeros((outputs, inputs), np.int64) for _ in range(2))
    for output in range(outputs):
        factor = _triangulate(signals, output, lags, reach, direct)
        count = lags + inputs * reach + 1
        norms = np.linalg.norm(factor[:, :count], axis=0)
        norms[norms == 0.0] = 1.0
        u, s, vt = np.linalg.svd(factor[:, :count] / norms)
        kept = s > 1e-10 * s[0]
        moment = (u.T @ factor[:, count])[:count]
        theta = (vt[kept].T @ (moment[kept] / s[kept])) / norms
        rest = factor[:, count] - factor[:, :count] @ theta
        variance = float(rest @ rest) / max(1, signals.samples - count)
        errors = np.sqrt(variance * np.sum((vt[kept] / s[kept, None]) ** 2, axis=0)) / norms
        numerators = theta[lags:-1].reshape(inputs, reach)
        significant = np.abs(numerators) > _SIGNIFICANT * errors[lags:-1].reshape(inputs, reach)
        first[output] = np.where(significant.any(axis=1), significant.argmax(axis=1), direct)
        delays[output] = np.clip(first[output] - direct, 0, largest_delay)
        # The response to the same sample is no response of the modes.
        length = direct + _RESPONSE
        pulses = np.zeros((inputs, length))
        for place, delay in enumerate(delays[output]):
            taken = min(reach - delay, length)
            pulses[place, :taken] = numerators[place, delay : delay + taken]
        responses.append(divide_rows(-theta[:lags], pulses, np.array([length]))[:, direct:])
    response = np.array(responses)  # (outputs, inputs, lags)
    if not np.isfinite(response).all() or np.abs(response).max() > 1e6:
        return None
    return HighOrder(delays, first < direct, _find_vectors(response), outputs)


def _find_vectors(response: Signal) -> Signal:
    """Return the left singular vectors of the Hankel matrix of responses (outputs, inputs, lags)."""
    outputs, inputs, samples = response.shape
    half = samples // 2
    windows = sliding_window_view(response, half, axis=2)[:, :, :half]  # (outputs, inputs, half, half)
    hankel = windows.transpose(2, 0, 1, 3).reshape(half * outputs, inputs * half)
    return np.asarray(np.linalg.svd(hankel, full_matrices=False)[0])


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
