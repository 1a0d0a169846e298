"""Masked values of NumPy arrays as missing values."""

from typing import Any

import numpy as np


def fill_masked(values: Any) -> Any:
    """Return a masked array, or a sequence that contains one, as an array with missing values.

    `numpy.asarray` returns the numbers under the mask instead. Other values are returned as they are.

    Returns
    -------
    Any
        NaN in place of masked numbers, NaT of masked times, None of other masked values.
    """
    if isinstance(values, list | tuple) and any(isinstance(each, np.ma.MaskedArray) for each in values):
        values = np.ma.asarray(values)
    return _fill(values) if isinstance(values, np.ma.MaskedArray) else values


def _fill(values: Any) -> Any:
    kind = values.dtype.kind
    if kind in "mM":
        return values.filled(np.array("NaT", values.dtype))
    return values.astype(np.float64).filled(np.nan) if kind in "fiub" else values.astype(object).filled(None)
