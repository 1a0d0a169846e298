"""Drift of the output: a slow change in time that the inputs do not explain."""

from itertools import pairwise
from math import erf, sqrt

import numpy as np

from islands.records.dataset import Dataset
from islands.records.inspection.fact import Fact

#: Intervals of equal length whose means are compared, and the fewest of them.
_INTERVALS, _LEAST_INTERVALS = 64, 16

#: Powers of the inputs that explain the means, and most inputs.
_POWERS, _MOST_INPUTS = (1, 2, 3), 4

#: Smallest drift, relative to the range of the output and to its standard error.
_LEAST_DRIFT, _STANDARD_ERRORS = 0.01, 3.0


def measure_drift(record: Dataset) -> Fact:
    """Return how much the output changes over the record beyond what the means of the inputs explain.

    Returns
    -------
    Fact
        The value is the linear change from the first to the last sample, with its 95 % interval. The
        confidence is the probability that the sign is right.
    """
    name, unit = record.output_name, record.output_unit
    intervals = min(_INTERVALS, record.samples // 8)
    if intervals < _LEAST_INTERVALS:
        return Fact("drift", name, "drift_short", unit=unit)
    cuts = np.linspace(0, record.samples, intervals + 1).astype(int)
    known = [slice(a, b) for a, b in pairwise(cuts.tolist()) if np.isfinite(record.y[a:b]).all()]
    if len(known) < _LEAST_INTERVALS:
        return Fact("drift", name, "drift_missing", unit=unit)
    y = np.array([record.y[part].mean() for part in known])
    time = np.array([0.5 * (part.start + part.stop) / record.samples - 0.5 for part in known])
    columns = [np.ones(len(y)), time]
    for signal in record.u.T[:_MOST_INPUTS]:
        size = float(np.std(signal))
        if size > 0.0:
            scaled = (signal - signal.mean()) / size
            columns += [np.array([np.mean(scaled[part] ** power) for part in known]) for power in _POWERS]
    x = np.array(columns).T
    weights = np.linalg.lstsq(x, y, rcond=None)[0]
    residual = y - np.einsum("ij,j->i", x, weights)
    freedom = max(1, len(y) - x.shape[1])
    inverse = np.linalg.pinv(np.einsum("ri,rj->ij", x, x))
    error = sqrt(max(float(np.sum(residual**2)) / freedom * float(inverse[1, 1]), 0.0))
    # Neighbouring means are correlated: fewer of them are independent.
    scale = float(np.sum(residual**2))
    correlation = float(np.sum(residual[1:] * residual[:-1])) / scale if scale > 0.0 else 0.0
    error *= sqrt((1.0 + max(correlation, 0.0)) / (1.0 - min(max(correlation, 0.0), 0.9)))
    change, extent = float(weights[1]), record.output_range
    significant = abs(change) >= max(_STANDARD_ERRORS * error, _LEAST_DRIFT * extent)
    part = 100.0 * change / extent if extent > 0.0 else 0.0
    finding = "drift_visible" if significant else "drift_none"
    right = 0.5 * (1.0 + erf(abs(change) / error / sqrt(2.0))) if error > 0.0 else 1.0
    interval = (change - 2 * error, change + 2 * error)
    return Fact("drift", name, finding, change, unit, interval, right, {"percent": part})
