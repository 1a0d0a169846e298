"""What a reader hands on: a file's named columns, and the numbers of those that are asked for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError


@dataclass(frozen=True, slots=True, eq=False)
class RowRange:
    """Where the samples stand in their file, as a person counts them there.

    Attributes
    ----------
    file : str
        The file's name.
    counted : str
        What is counted: ``"line"`` (the header is line 1) or ``"sample"`` (the first one is 0).
    numbers : sequence of int
        The line or sample number of every sample.
    """

    file: str
    counted: str
    numbers: Sequence[int]

    def place(self, sample: int, column: str) -> str:
        """Name the cell of a sample: ``record.csv, line 14, column u_V``."""
        return f"{self.file}, {self.row(sample)}, column {column}"

    def row(self, sample: int) -> str:
        """Name the row of a sample: ``line 14``."""
        return f"{self.counted} {self.numbers[sample]}"

    def __len__(self) -> int:
        return len(self.numbers)


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Numbers of the columns asked for, over the selected rows.

    Attributes
    ----------
    rows : RowRange
        Where the samples stand in the file.
    numbers : mapping of str to ndarray, shape (samples,)
        float64, all of one length; NaN where the cell is missing.
    first : int
        Number of the first selected sample in the file, from 0.
    """

    rows: RowRange
    numbers: Mapping[str, NDArray[np.float64]]
    first: int


class Table(Protocol):
    """An opened file. Law: a column that is not asked for is never converted and so can do no harm."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns in the file's order."""
        ...

    def stated(self, structure: str) -> Mapping[str, float]:
        """Return the sampling times in seconds that the file states besides a time column, by their arrays.

        Those among the fields of the structure (`islands.io.records.column_names.split_structures`) go before
        those at the top, and those of other structures do not count.

        Raises
        ------
        RecordError
            What is stated is not a positive number.
        """
        ...

    def read(self, names: Sequence[str], rows: slice | None) -> Columns:
        """Convert the named columns over the selected rows.

        Raises
        ------
        RecordError
            A cell is text, the channels are of unequal lengths, or the selection does not fit the file.
        """
        ...

    def remarks(self, names: Sequence[str]) -> tuple[str, ...]:
        """Say what was inferred to read the named columns, whole, or what forbids to read them together."""
        ...


def select(rows: slice | None, samples: int, file: str) -> range:
    """Return the samples of a selection; unlike a Python slice it is never cut to what is there.

    Raises
    ------
    RecordError
        The selection is empty, reaches past the samples, or takes steps.
    """
    if rows is None:
        return range(samples)
    first, last = (
        default if bound is None else bound + samples * (bound < 0)
        for bound, default in ((rows.start, 0), (rows.stop, samples))
    )
    if rows.step not in (None, 1) or not 0 <= first < last <= samples:
        raise RecordError(
            f"{file} has samples 0 to {samples - 1}: rows {_shown(rows)} are not a part of it. "
            "Give first:stop, counted from 0 without the header, stop not included"
        )
    return range(first, last)


def _shown(rows: slice) -> str:
    bounds = (rows.start, rows.stop) if rows.step is None else (rows.start, rows.stop, rows.step)
    return ":".join("" if bound is None else str(bound) for bound in bounds)
