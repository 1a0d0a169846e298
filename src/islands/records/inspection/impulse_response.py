"""Impulse response of the output to an input, by least squares.

The increments of the output are regressed on those of the input at all lags (finite impulse response; Ljung
1999, section 4.2), so that a drift of the output has no influence.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset

#: Lags of the response.
_LAGS = 60

#: Samples of the longest segment that are used, at most, and at least for every lag.
_SAMPLES, _SAMPLES_PER_LAG = 20_000, 4

#: Part of the increments of an input that its past does not predict, at least, as a ratio of rms.
_LEAST_INNOVATION = 0.01

#: Standard errors of the band.
_BAND = 1.96


@dataclass(frozen=True, slots=True, eq=False)
class ImpulseResponse:
    """Impulse response at the lags 0, 1, ....

    Attributes
    ----------
    values : ndarray, shape (lags,)
        In units of the output per unit of the input.
    errors : ndarray, shape (lags,)
        Half width of the 95 % band of a response of zero.
    """

    values: NDArray[np.float64]
    errors: NDArray[np.float64]


def estimate_impulse_response(record: Dataset, place: int) -> ImpulseResponse | None:
    """Estimate the impulse response to an input; None if the record does not tell it.

    The record may be too short, a signal constant, or the input predictable from its past.

    Parameters
    ----------
    record : Dataset
        The longest segment is used. Other inputs count as noise.
    place : int
        Index of the input, from 0.
    """
    begin, end = max(record.bounds, key=lambda bounds: bounds[1] - bounds[0])
    part = slice(begin, min(end, begin + _SAMPLES))
    u, y = np.diff(record.u[part, place]), np.diff(record.y[part])
    lags = min(_LAGS, len(u) // (1 + _SAMPLES_PER_LAG))
    if lags < 2 or not np.ptp(u) > 0.0:
        return None
    rows = np.arange(lags - 1, len(u))
    rows = rows[np.isfinite(y[rows])]
    lagged = np.array([u[rows - lag] for lag in range(lags)])
    if rows.size < _SAMPLES_PER_LAG * lags or not np.ptp(y[rows]) > 0.0:
        return None
    gram = np.einsum("ir,jr->ij", lagged, lagged)
    power = float(np.trace(gram)) / lags
    # The smallest eigenvalue bounds the power of the part of the input that its past does not predict.
    if not np.linalg.eigvalsh(gram)[0] > _LEAST_INNOVATION**2 * power:
        return None
    inverse = np.linalg.inv(gram)
    values = np.einsum("ij,j->i", inverse, np.einsum("ir,r->i", lagged, y[rows]))
    left = y[rows] - np.einsum("ir,i->r", lagged, values)
    variance = float(np.sum(left**2)) / (rows.size - lags)
    return ImpulseResponse(values, _BAND * np.sqrt(variance * np.diag(inverse)))
