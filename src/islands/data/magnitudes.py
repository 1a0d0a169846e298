"""Magnitudes of signals: statistics of very large and very small numbers overflow or vanish."""

import numpy as np

from islands.data.dataset import Dataset
from islands.errors import RecordError

#: Largest magnitude of a value, and least range of a signal that varies. Products of three are representable.
MAX_MAGNITUDE, MIN_RANGE = 1e100, 1e-100


def check_magnitudes(record: Dataset) -> None:
    """Refuse a record with a signal of which squares and products are beyond the range of numbers.

    Raises
    ------
    RecordError
        The message names the column.
    """
    columns = (*record.u.T, record.y)
    for name, values in zip((*record.input_names, record.output_name), columns, strict=True):
        known = values[np.isfinite(values)]
        if not known.size:
            continue
        if (peak := float(np.max(np.abs(known)))) > MAX_MAGNITUDE:
            raise RecordError(
                f"column {name} reaches {peak:.3g}, and {MAX_MAGNITUDE:g} is the most: correct it, or select "
                "other rows"
            )
        if 0.0 < (spread := float(np.ptp(known))) < MIN_RANGE:
            raise RecordError(
                f"column {name} varies by {spread:.3g}, and {MIN_RANGE:g} is the least: give it in a "
                "smaller unit"
            )
