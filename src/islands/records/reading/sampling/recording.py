"""Samples with their times, before and after they are brought to a uniform grid."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from islands.records.reading.table import RowRange


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """Samples with their times.

    Attributes
    ----------
    rows : RowRange
        Position of the samples in the file.
    stamps : ndarray, shape (samples,)
        Times in the unit of the time column.
    values : ndarray, shape (samples, columns)
        The columns; NaN marks a missing value.
    time : str
        Name of the time column, for messages.
    seconds : float
        Unit of the stamps in seconds.
    """

    rows: RowRange
    stamps: NDArray[np.float64]
    values: NDArray[np.float64]
    time: str
    seconds: float

    def __getitem__(self, kept: NDArray[np.bool_] | NDArray[np.int64] | slice) -> "Recording":
        """Return a part of the samples."""
        numbers = np.asarray(self.rows.numbers)[kept].tolist()
        rows = RowRange(self.rows.file, self.rows.counted, numbers)
        return replace(self, rows=rows, stamps=self.stamps[kept], values=self.values[kept])


def count_text(count: int, noun: str) -> str:
    """Return a number with its noun: ``1 row``, ``2 rows``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


@dataclass(frozen=True, slots=True, eq=False)
class UniformRecording:
    """Uniformly sampled segments.

    Attributes
    ----------
    values : ndarray, shape (samples, columns)
    dt, start : float
        Sampling time and time of the first sample, in seconds.
    segments : tuple of int
        Lengths of the segments.
    steps : tuple of str
        What was done, in the order in which it was done.
    """

    values: NDArray[np.float64]
    dt: float
    start: float
    segments: tuple[int, ...]
    steps: tuple[str, ...]
