"""Conversion of text cells to numbers.

Whole columns are converted at once; only if that fails is the invalid cell searched.
"""

import reprlib
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.io.records.column_names import looks_like_time
from islands.io.records.formats.text.number_format import NumberFormat, find_number_format
from islands.io.records.table import RowRange

#: Cells that mean a missing value, in lower case.
MISSING = frozenset({"", "nan", "na", "n/a", "null", "-", "--", "---", "#n/a", "none"})


def is_missing(text: str) -> bool:
    """Return whether a cell has no value."""
    return text.strip().lower() in MISSING


def parse_numbers(
    texts: Mapping[str, Sequence[str]], rows: RowRange, decimal: str | None = None, separator: str = ""
) -> dict[str, NDArray[np.float64]]:
    """Convert columns of cells to float64 arrays, shape (samples,). Cells in `MISSING` become NaN.

    Parameters
    ----------
    texts : mapping of str to sequence of str
        The cells of every column; all columns have equal length.
    rows : RowRange
        Position of the cells in the file.
    decimal, separator
        See `find_number_format`.

    Raises
    ------
    RecordError
        A cell is text, or the decimal mark is not certain.
    """
    plain = {name: _convert(column) for name, column in texts.items()}
    numbers = {name: column for name, column in plain.items() if column is not None}
    if len(numbers) < len(texts) or decimal == ",":
        written = find_number_format(texts, rows, decimal, separator)
        numbers = {name: _convert_written(column, name, written, rows) for name, column in texts.items()}
    return numbers


def describe_numbers(
    texts: Mapping[str, Sequence[str]], rows: RowRange, decimal: str | None = None, separator: str = ""
) -> str:
    """Return what was inferred about how numbers are written; empty for numbers with points only.

    The parameters are those of `parse_numbers`.

    Raises
    ------
    RecordError
        The decimal mark is not certain.
    """
    # A number of Python has neither a comma nor separate thousands. Its conversion takes a tenth of the time.
    if decimal != "," and all(_convert(column) is not None for column in texts.values()):
        return ""
    return find_number_format(texts, rows, decimal, separator).note


def _convert(texts: Sequence[str]) -> NDArray[np.float64] | None:
    """Convert a whole column; None if a cell is not a number."""
    try:
        numbers = np.fromiter(map(float, texts), np.float64, len(texts))
    except ValueError:
        return None
    return None if "_" in "".join(texts) else numbers  # float("1_5") is 15.0


def _convert_written(
    texts: Sequence[str], name: str, written: NumberFormat, rows: RowRange
) -> NDArray[np.float64]:
    """Convert a column with missing cells, decimal commas or separated thousands.

    Raises
    ------
    RecordError
        A cell is text.
    """
    normalised = ["nan" if is_missing(text) else written.normalise(text) for text in texts]
    numbers = _convert(normalised)
    if numbers is not None:
        return numbers
    sample = next(index for index, text in enumerate(normalised) if _convert([text]) is None)
    shown = reprlib.repr(texts[sample].strip())
    advice = "correct the cell or leave its row out"
    if looks_like_time(name):
        advice = (
            "write the time as a number or as 2026-11-22 14:05:03.250, or rename the column if it is not to "
            "be read as time"
        )
    raise RecordError(f"{rows.place(sample, name)}: {shown} is not a number: {advice}")
