"""Cells with a number and its unit, such as ``0.86 V`` and ``86 %``."""

import re
import reprlib
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.records.channel_names import conversion_factor, is_unit, normalise_unit, parse_unit, spell_unit
from islands.records.reading.formats.text.missing_words import is_missing
from islands.records.reading.formats.text.number_format import is_number
from islands.records.reading.formats.text.time_stamps import kind_of
from islands.records.reading.table import RowRange

#: Cells with a value that decide whether a column has units.
_DECIDING = 20

#: Largest number of characters of a unit.
_MOST_UNIT = 12

# A run of characters must match in one way only: otherwise the time grows with the square of its length.
_NUMBER = re.compile(r"[+-]?[\d.,][\d.,'\s]*(?:[eE][+-]?\d+)?")


def split_quantity(text: str) -> tuple[str, str] | None:
    """Return the number and the unit of a cell; None if it is not a number with a unit.

    Behind a blank, the unit may be a word that is not known as a unit: ``400 ppm``.
    """
    text = text.strip()
    if not (match := _NUMBER.match(text)):
        return None
    number, unit = match[0].rstrip(), text[match.end() :].lstrip()
    has_blank = len(number) + len(unit) < len(text)
    if not 0 < len(unit) <= _MOST_UNIT or not is_number(number):
        return None
    unit = spell_unit(unit)
    is_known = is_unit(unit) or (has_blank and unit[0].isalpha())
    return (number, unit) if is_known and not kind_of(text) else None


def find_unit(texts: Iterable[str], given: Collection[str] = ()) -> str:
    """Return the unit of the cells of a column; empty if they have none.

    The first cells with a value decide. Their units are equal, or differ in an SI prefix only; the first one
    is returned.

    Parameters
    ----------
    texts : iterable of str
    given : collection of str
        Words of the user for a missing value, in lower case.
    """
    filled = (text for text in texts if not is_missing(text, given))
    unit = ""
    for part in map(split_quantity, islice(filled, _DECIDING)):
        if part is None or (unit and find_factor(part[1], unit) is None):
            return ""
        unit = unit or part[1]
    return unit


def find_factor(unit: str, other: str) -> float | None:
    """Return the factor from a unit to another; None if they differ in more than an SI prefix."""
    return 1.0 if normalise_unit(unit) == normalise_unit(other) else conversion_factor(unit, other)


@dataclass(frozen=True, slots=True)
class PlainCells:
    """Cells of a column without their units.

    Attributes
    ----------
    texts : list of str
        The numbers; missing cells are unchanged.
    factors : ndarray, shape (samples,), or None
        Factors to the unit of the column; None if all are 1.
    note : str
        What was read from the cells.
    """

    texts: list[str]
    factors: NDArray[np.float64] | None
    note: str


def remove_units(
    texts: Sequence[str], name: str, unit: str, rows: RowRange, given: Collection[str] = ()
) -> PlainCells:
    """Separate the numbers of a column from their units, which become the unit of its name or of its cells.

    Parameters
    ----------
    texts : sequence of str
    name : str
        Name of the column. If it states a unit, the cells are converted to it.
    unit : str
        Unit of the cells by `find_unit`.
    rows : RowRange
        Position of the cells in the file.
    given : collection of str
        Words of the user for a missing value, in lower case.

    Raises
    ------
    RecordError
        A cell has no unit, or one that cannot be converted.
    """
    target = parse_unit(name) or unit
    factors = np.ones(len(texts))
    numbers = list(texts)
    converted: list[int] = []
    for sample, text in enumerate(texts):
        if is_missing(text, given):
            continue
        part = split_quantity(text)
        factor = None if part is None else find_factor(part[1], target)
        if part is None or factor is None:
            raise RecordError(
                f"{rows.place(sample, name)}: {reprlib.repr(text.strip())} is not a number in {target}, the "
                "unit of the column: write all cells of the column with one unit, or with none"
            )
        numbers[sample], factors[sample] = part[0], factor
        if factor != 1.0:
            converted.append(sample)
    note = f"the unit of column {name} is read from its cells"
    if converted:
        found = split_quantity(texts[converted[0]])
        assert found is not None
        note += (
            f"; {len(converted)} of them, the first in {rows.row(converted[0])}, are in another unit, as "
            f"{found[1]}, and are converted to {target}"
        )
    return PlainCells(numbers, factors if converted else None, note)
