"""Interface of a record reader: the columns of an opened file and their numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError


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
    starts : tuple of int
        Samples that follow a repeated header of the file.
    notes : tuple of str
        What was assumed about cells and rows, such as missing values and a footer.
    units : mapping of str to str
        Units in cells, of columns whose names do not state them.
    """

    rows: RowRange
    numbers: Mapping[str, NDArray[np.float64]]
    first: int
    clocks: frozenset[str] = frozenset()
    starts: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    def split(self, time: str | None) -> tuple["Columns", ...]:
        """Return the recordings: the samples between repeated headers.

        A header after which the time continues with the usual step, as in a listing of pages, does not begin
        a recording.

        Parameters
        ----------
        time : str or None
            The time column; without one, every header begins a recording.
        """
        starts = self.starts if time is None else self._find_jumps(self.numbers[time])
        if not starts:
            return (self,)
        ends = pairwise((0, *starts, len(self.rows)))
        return tuple(self._cut(slice(begin, end)) for begin, end in ends)

    def _find_jumps(self, stamps: NDArray[np.float64]) -> tuple[int, ...]:
        """Return the starts at which the time does not continue with the usual step."""
        if not self.starts:
            return ()
        steps = np.diff(stamps)
        usual = float(np.median(steps[np.isfinite(steps)])) if np.isfinite(steps).any() else 0.0
        return tuple(at for at in self.starts if not abs(steps[at - 1] - usual) < 0.5 * usual)

    def _cut(self, kept: slice) -> "Columns":
        return replace(
            self,
            rows=RowRange(self.rows.file, self.rows.counted, self.rows.numbers[kept]),
            numbers={name: column[kept] for name, column in self.numbers.items()},
            first=self.first + kept.start,
            starts=(),
        )


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

        Fields of the structure (`islands.records.reading.column_names.split_structures`) take precedence over
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
    SettingsError
        It is not a slice.
    """
    if rows is None:
        return range(samples)
    if not isinstance(rows, slice):
        raise SettingsError(f"rows is a slice such as slice(0, {samples}), got {rows!r}")
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
