"""Interface of a record reader: the columns of an opened file and their numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError


@dataclass(frozen=True, slots=True, eq=False)
class RowRange:
    """Position of samples in their file, for error messages.

    Attributes
    ----------
    file : str
        The file's name.
    counted : str
        Unit of the numbers: ``"line"`` or ``"row"`` (the first is 1), or ``"sample"`` (the first is 0).
    numbers : sequence of int
        Line or sample number of every sample.
    """

    file: str
    counted: str
    numbers: Sequence[int]

    def place(self, sample: int, column: str) -> str:
        """Return the position of a cell as text: ``record.csv, line 14, column u_V``."""
        return f"{self.file}, {self.row(sample)}, column {column}"

    def row(self, sample: int) -> str:
        """Return the row of a sample as text: ``line 14``."""
        return f"{self.counted} {self.numbers[sample]}"

    def __len__(self) -> int:
        return len(self.numbers)


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Numbers of the requested columns over the selected rows.

    Attributes
    ----------
    rows : RowRange
        Position of the samples in the file.
    numbers : mapping of str to ndarray, shape (samples,)
        float64 arrays of equal length; missing cells are NaN.
    first : int
        Index of the first selected sample in the file, from 0.
    clocks : frozenset of str
        Columns of time stamps: their numbers are seconds after the first selected sample.
    """

    rows: RowRange
    numbers: Mapping[str, NDArray[np.float64]]
    first: int
    clocks: frozenset[str] = frozenset()


class Table(Protocol):
    """An opened file.

    Implementations convert only the requested columns, so that errors in other columns do no harm.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns in the file's order."""
        ...

    @property
    def clocks(self) -> Mapping[str, str]:
        """Columns of time stamps, with the column that contains their dates; empty if there is none."""
        ...

    @property
    def others(self) -> str:
        """Which table of the file is read, and which others it has; empty if there is one."""
        ...

    def stated(self, structure: str) -> Mapping[str, float]:
        """Return the sampling times that the file states as single numbers, in seconds, by array name.

        Fields of the structure (`islands.io.records.column_names.split_structures`) take precedence over
        arrays at the top level; fields of other structures are ignored.

        Raises
        ------
        RecordError
            A stated sampling time is not a positive number.
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
        """Return what was inferred when reading the named columns, or why they cannot be read together."""
        ...


def select(rows: slice | None, samples: int, file: str) -> range:
    """Return the samples of a selection. Unlike a Python slice, it is never clipped to the available samples.

    Raises
    ------
    RecordError
        The selection is empty, extends past the samples, or has a step.
    """
    if rows is None:
        return range(samples)
    first, last = (
        default if bound is None else bound + samples * (bound < 0)
        for bound, default in ((rows.start, 0), (rows.stop, samples))
    )
    if rows.step not in (None, 1) or not 0 <= first < last <= samples:
        raise RecordError(
            f"{file} has samples 0 to {samples - 1}: rows {_format_slice(rows)} are not a part of it. "
            "Give first:stop, counted from 0 without the header, stop not included"
        )
    return range(first, last)


def _format_slice(rows: slice) -> str:
    bounds = (rows.start, rows.stop) if rows.step is None else (rows.start, rows.stop, rows.step)
    return ":".join("" if bound is None else str(bound) for bound in bounds)
