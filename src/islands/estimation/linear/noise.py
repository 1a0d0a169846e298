"""Noise of a linear model from the residual of its free run, after Hannan and Rissanen (1982).

A long autoregression has the innovations. The regression of the residual on its own lags and on those of the
innovations then has the noise of every order in one triangular factor, as its columns are nested.
"""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from islands.kernels.linear_filter import filter_linearly

Signal = NDArray[np.float64]

#: Noise without colour.
WHITE = np.zeros((2, 0))

#: Lags of the long autoregression, states of the noise, and samples for each of its coefficients, at least.
_LAGS, _STATES, _SAMPLES_PER_COEFFICIENT = 50, 8, 10


def limit_zeros(samples: int) -> float:
    """Return the largest magnitude of the zeros of noise that a record shows.

    Zeros nearer to the unit circle lack a band of frequencies that is narrower than one period of the record.
    Residuals lack it in any case, as the operating point and drifts are estimated.
    """
    return 1.0 - 2.0 * np.pi / max(samples, 8)


def fit_noises(residual: Signal, lengths: Sequence[int], poles: NDArray[np.complex128]) -> list[Signal]:
    """Return noise that is added to an output, and noise that drives the states of the system.

    Parameters
    ----------
    residual : ndarray, shape (samples,)
    lengths : sequence of int
        Of the recordings in samples.
    poles : ndarray
        Of the system.

    Returns
    -------
    list of ndarray, each of shape (2, states)
        Coefficients of past values, and of past innovations. The first one has the number of states of the
        least information criterion of Schwarz, the second one the poles of the system.
    """
    parts = np.split(residual, np.cumsum(lengths)[:-1])
    lags = min(_LAGS, min(lengths) // _SAMPLES_PER_COEFFICIENT)
    states = min(_STATES, lags // 3)
    if states == 0:
        return [WHITE]
    rows = [_lag(part, lags, lags) for part in parts]
    long = _select(np.vstack([np.column_stack(each) for each in rows]), 1, 2.0)
    innovations = [target - past[:, : long.size] @ long for past, target in rows]
    most = max(states, poles.size)
    pairs = [
        (*_lag(part[lags:], most, most), _lag(innovation, most, most)[0])
        for part, innovation in zip(parts, innovations, strict=True)
    ]
    past, now, before = (np.concatenate(each) for each in zip(*pairs, strict=True))
    nested = np.stack([past, before], axis=2)[:, :states].reshape(len(now), -1)
    added = _select(np.column_stack([nested, now]), 2, float(np.log(now.size))).reshape(-1, 2).T
    largest = limit_zeros(residual.size)
    found = [np.array([added[0], _invert(added[1], largest)])]
    if poles.size:
        own = -np.poly(poles).real[1:]
        columns = before[:, : own.size]
        moving = np.linalg.lstsq(columns, now - past[:, : own.size] @ own, rcond=1e-10)[0]
        found.append(np.array([own, _invert(moving, largest)]))
    return found


def _lag(values: Signal, lags: int, first: int) -> tuple[Signal, Signal]:
    """Return the lags of values from a sample on, shape (samples, lags), and the values."""
    windows = sliding_window_view(values, lags + 1)[first - lags :, ::-1]
    return windows[:, 1:], windows[:, 0]


def _select(rows: Signal, step: int, penalty: float) -> Signal:
    """Return the coefficients of the first columns with the least criterion; the target is last."""
    factor = np.asarray(np.linalg.qr(rows, mode="r"))
    squares = np.cumsum(factor[::-1, -1] ** 2)[::-1]  # left by the columns before
    counts = np.arange(0, rows.shape[1], step)
    best = counts[np.argmin(len(rows) * np.log(squares[counts] + np.finfo(float).tiny) + penalty * counts)]
    found: Signal = np.linalg.lstsq(factor[:best, :best], factor[:best, -1], rcond=1e-10)[0]
    return found


def _invert(moving: Signal, largest: float) -> Signal:
    """Return a moving average with its zeros inside of a circle, of the same spectrum if it can be."""
    zeros = np.roots([1.0, *moving]).astype(np.complex128)
    outside = np.abs(zeros) > 1.0
    zeros[outside] = 1.0 / zeros[outside].conj()
    zeros *= np.minimum(1.0, 0.999 * largest / np.maximum(np.abs(zeros), 1e-12))
    inside: Signal = np.atleast_1d(np.poly(zeros)).real[1:]
    return inside


def whiten(residual: Signal, noise: Signal) -> Signal:
    """Return the white noise behind the residual of a recording; see `Structure.noise`."""
    past, white = noise
    return np.asarray(filter_linearly([1.0, *-past], [1.0, *white], residual), np.float64)
