"""Envelopes of signals as documents, for plots with fewer points than the signals have samples."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.records.envelope import find_envelope


def describe_envelopes(
    signals: Mapping[str, NDArray[np.float64]], start: int, points: int
) -> tuple[list[int], list[dict[str, Any]]]:
    """Return the first rows of the parts of signals, and the extremes of the signals in them, as JSON.

    Parameters
    ----------
    signals : mapping of str to ndarray, shape (samples,)
        Signals of the same rows.
    start : int
        First row.
    points : int
        Largest number of parts.

    Returns
    -------
    rows : list of int
    columns : list of dict
        Fields of `islands_api.schemas.Envelope`.
    """
    columns, first = [], np.empty(0, np.int64)
    for name, values in signals.items():
        least, greatest, first = find_envelope(values, points)
        columns.append({"name": name, "minimum": _to_list(least), "maximum": _to_list(greatest)})
    return (first + start).tolist(), columns


def _to_list(values: NDArray[np.float64]) -> list[float | None]:
    """Return values as JSON has them: None for missing and infinite ones."""
    return [
        value if known else None for value, known in zip(values.tolist(), np.isfinite(values), strict=True)
    ]
