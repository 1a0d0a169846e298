"""Signals of a record with their names and units."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """An input or the output of a record.

    Attributes
    ----------
    name, unit : str
        As in the record.
    values : ndarray, shape (samples,)
        NaN marks a missing value.
    is_output : bool
        Whether it is the output.
    """

    name: str
    unit: str
    values: NDArray[np.float64]
    is_output: bool

    @property
    def known(self) -> NDArray[np.float64]:
        """Values that are not missing."""
        return self.values[np.isfinite(self.values)]


def channels(record: Dataset) -> tuple[Channel, ...]:
    """Return the inputs and the output of a record, in this order."""
    inputs = (
        Channel(name, unit, np.ascontiguousarray(signal), is_output=False)
        for name, unit, signal in zip(record.input_names, record.input_units, record.u.T, strict=True)
    )
    return (*inputs, Channel(record.output_name, record.output_unit, record.y, is_output=True))
