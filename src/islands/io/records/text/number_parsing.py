"""Conversion of text cells to numbers.

Whole columns are converted at once; only if that fails is the invalid cell searched.
"""

import re
import reprlib
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.io.records.column_names import looks_like_time
from islands.io.records.table import RowRange

#: Cells that mean a missing value, in lower case.
MISSING = frozenset({"", "nan", "na", "n/a", "null"})

_NUMBER = re.compile(r"\s*[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?\s*")


def is_number(text: str) -> bool:
    """Return whether a cell is a finite number with a decimal point or a decimal comma."""
    return bool(_NUMBER.fullmatch(text))


def parse_numbers(texts: Mapping[str, Sequence[str]], rows: RowRange) -> dict[str, NDArray[np.float64]]:
    """Convert columns of cells to float64 arrays, shape (samples,). Cells in `MISSING` become NaN.

    Parameters
    ----------
    texts : mapping of str to sequence of str
        The cells of every column; all columns have equal length.
    rows : RowRange
        Position of the cells in the file.

    Raises
    ------
    RecordError
        A cell is text, or decimal commas and decimal points are mixed.
    """
    plain = {name: _convert(column) for name, column in texts.items()}
    numbers = {name: column for name, column in plain.items() if column is not None}
    if len(numbers) < len(texts):
        mark = "," if find_decimal_comma(texts, rows) else "."
        numbers = {name: _convert_with_mark(column, name, mark, rows) for name, column in texts.items()}
    return numbers


def _convert(texts: Sequence[str]) -> NDArray[np.float64] | None:
    """Convert a whole column; None if a cell is not a number."""
    try:
        numbers = np.fromiter(map(float, texts), np.float64, len(texts))
    except ValueError:
        return None
    return None if "_" in "".join(texts) else numbers  # float("1_5") is 15.0


def find_decimal_comma(texts: Mapping[str, Sequence[str]], rows: RowRange) -> str | None:
    """Return the position of the first decimal comma, None if all numbers use points.

    Raises
    ------
    RecordError
        There are also decimal points. All columns must use the same mark, because next to ``0.5`` the number
        ``1,234`` probably means one thousand two hundred and thirty-four.
    """

    def first(mark: str) -> str | None:
        for name, column in texts.items():
            for sample, text in enumerate(column):
                if mark in text and is_number(text):
                    return f"{rows.place(sample, name)} ({text.strip()})"
        return None

    comma = first(",")
    if comma and (point := first(".")):
        raise RecordError(
            f"a decimal comma in {comma}, a decimal point in {point}: write all numbers with the same mark, "
            "and without thousands separators"
        )
    return comma


def _convert_with_mark(texts: Sequence[str], name: str, mark: str, rows: RowRange) -> NDArray[np.float64]:
    """Convert a column with missing cells or decimal commas.

    Raises
    ------
    RecordError
        A cell is text.
    """
    normalised = ["nan" if text.strip().lower() in MISSING else text.replace(mark, ".") for text in texts]
    numbers = _convert(normalised)
    if numbers is not None:
        return numbers
    sample = next(index for index, text in enumerate(normalised) if _convert([text]) is None)
    shown = reprlib.repr(texts[sample].strip())
    advice = "correct the cell or leave its row out"
    if looks_like_time(name):
        advice = "write the time as a number, or rename the column if it is not to be read as time"
    raise RecordError(f"{rows.place(sample, name)}: {shown} is not a number: {advice}")
