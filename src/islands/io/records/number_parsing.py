"""From the cells of a text table to numbers: whole columns at once, a search for the bad cell only after."""

import re
import reprlib
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.io.records.column_names import looks_like_time
from islands.io.records.table import RowRange

#: Cells that mean "no value here", in lower case.
MISSING = frozenset({"", "nan", "na", "n/a", "null"})

_NUMBER = re.compile(r"\s*[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?\s*")


def is_number(text: str) -> bool:
    """Tell whether a cell is a finite number, with a decimal point or a decimal comma."""
    return bool(_NUMBER.fullmatch(text))


def parse_numbers(texts: Mapping[str, Sequence[str]], rows: RowRange) -> dict[str, NDArray[np.float64]]:
    """Convert columns of cells to float64, shape (samples,); NaN where a cell is one of `MISSING`.

    Parameters
    ----------
    texts : mapping of str to sequence of str
        The cells of every column, all of one length.
    rows : RowRange
        Where the cells stand in the file.

    Raises
    ------
    RecordError
        A cell is text, or decimal commas and decimal points are mixed.
    """
    plain = {name: _converted(column) for name, column in texts.items()}
    numbers = {name: column for name, column in plain.items() if column is not None}
    if len(numbers) < len(texts):
        mark = "," if decimal_comma(texts, rows) else "."
        numbers = {name: _mended(column, name, mark, rows) for name, column in texts.items()}
    return numbers


def _converted(texts: Sequence[str]) -> NDArray[np.float64] | None:
    """Convert a whole column, None if any cell resists."""
    try:
        numbers = np.fromiter(map(float, texts), np.float64, len(texts))
    except ValueError:
        return None
    return None if "_" in "".join(texts) else numbers  # to Python, 1_5 is fifteen


def decimal_comma(texts: Mapping[str, Sequence[str]], rows: RowRange) -> str | None:
    """Return the place of the first decimal comma, None where there is none.

    Raises
    ------
    RecordError
        There are decimal points too: all columns share a mark, since ``1,234`` beside ``0.5`` is a thousand.
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
            "and none with a mark for thousands"
        )
    return comma


def _mended(texts: Sequence[str], name: str, mark: str, rows: RowRange) -> NDArray[np.float64]:
    """Convert a column with missing cells or decimal commas, or name the cell that is text."""
    mended = ["nan" if text.strip().lower() in MISSING else text.replace(mark, ".") for text in texts]
    numbers = _converted(mended)
    if numbers is not None:
        return numbers
    sample = next(index for index, text in enumerate(mended) if _converted([text]) is None)
    shown = reprlib.repr(texts[sample].strip())
    advice = "mend the cell or leave its row out"
    if looks_like_time(name):
        advice = "write the time as a number, or rename the column if it is not to be read as time"
    raise RecordError(f"{rows.place(sample, name)}: {shown} is not a number: {advice}")
