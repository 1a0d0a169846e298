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
    if not isinstance(values, np.ma.MaskedArray):
        return values
    kind = values.dtype.kind
    if kind in "fiub":
        return values.astype(np.float64).filled(np.nan)
    return (
        values.filled(np.array("NaT", values.dtype)) if kind in "mM" else values.astype(object).filled(None)
    )
