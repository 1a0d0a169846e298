"""Conversion of text cells to numbers.

Whole columns are converted at once; only if that fails is the invalid cell searched.
"""

import reprlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, join_text, name_option
from islands.records.reading.column_names import looks_like_time
from islands.records.reading.formats.text.missing_words import (
    EMPTY,
    NO_WORDS,
    OPEN_CIRCUIT,
    MissingWords,
    is_missing,
)
from islands.records.reading.formats.text.number_format import NumberFormat, find_number_format
from islands.records.reading.formats.text.quantities import remove_units
from islands.records.reading.formats.text.states import find_states
from islands.records.reading.table import RowRange

#: A missing cell after the words are replaced.
_MISSING = "nan"

#: Words that a note lists, and characters of a word in a message.
_LISTED, _SHOWN = 3, 30


@dataclass(frozen=True, slots=True)
class ParsedNumbers:
    """Numbers of columns of cells.

    Attributes
    ----------
    numbers : dict of str to ndarray, shape (samples,)
        float64; NaN marks a missing value.
    notes : tuple of str
        What was assumed about cells that are not numbers: missing values, states, units.
    """

    numbers: dict[str, NDArray[np.float64]]
    notes: tuple[str, ...]


def parse_numbers(
    texts: Mapping[str, Sequence[str]],
    rows: RowRange,
    decimal: str | None = None,
    separator: str = "",
    missing: MissingWords = NO_WORDS,
    units: Mapping[str, str] = MappingProxyType({}),
) -> ParsedNumbers:
    """Convert columns of cells to float64 arrays, shape (samples,). Missing cells become NaN.

    Parameters
    ----------
    texts : mapping of str to sequence of str
        The cells of every column; all columns have equal length.
    rows : RowRange
        Position of the cells in the file.
    decimal, separator
        See `find_number_format`.
    missing : MissingWords
        Words of the user for a missing value.
    units : mapping of str to str
        Units of the cells of the columns that have them.

    Raises
    ------
    RecordError
        A cell is text, or the decimal mark is not certain.
    """
    plain = {name: _convert(column) for name, column in texts.items()}
    numbers = {name: column for name, column in plain.items() if column is not None}
    notes: list[str] = []
    if len(numbers) < len(texts) or decimal == ",":
        cells, factors = _read_words(
            {name: column for name, column in texts.items() if decimal == "," or name not in numbers},
            rows,
            missing,
            units,
            notes,
        )
        # The columns of numbers show how numbers are written, too.
        written = find_number_format({**texts, **cells}, rows, decimal, separator)
        for name, column in cells.items():
            numbers[name] = _convert_written(column, texts[name], name, written, rows)
            if (factor := factors.get(name)) is not None:
                numbers[name] *= factor
    if missing.numbers:
        for name in texts:
            numbers[name], removed = remove_numbers(numbers[name], name, missing.numbers, rows)
            notes.extend(removed)
    return ParsedNumbers({name: numbers[name] for name in texts}, tuple(notes))


def describe_numbers(
    texts: Mapping[str, Sequence[str]],
    rows: RowRange,
    decimal: str | None = None,
    separator: str = "",
    missing: MissingWords = NO_WORDS,
    units: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """Return what was inferred about how numbers are written; empty for numbers with points only.

    The parameters are those of `parse_numbers`.

    Raises
    ------
    RecordError
        The decimal mark is not certain.
    """
    # A number of Python has neither a comma nor separate thousands. Its conversion takes a tenth of the time.
    plain = {name for name, column in texts.items() if _convert(column) is not None}
    if decimal != "," and len(plain) == len(texts):
        return ""
    cells, _ = _read_words(
        {name: column for name, column in texts.items() if name not in plain}, rows, missing, units, []
    )
    return find_number_format({**texts, **cells}, rows, decimal, separator).note


def _read_words(
    texts: Mapping[str, Sequence[str]],
    rows: RowRange,
    missing: MissingWords,
    units: Mapping[str, str],
    notes: list[str],
) -> tuple[dict[str, Sequence[str]], dict[str, NDArray[np.float64]]]:
    """Return the cells with words replaced: missing ones by ``nan``, states by 1 and 0; without units.

    Also return the factors to the units of the columns.
    """
    cells: dict[str, Sequence[str]] = {}
    factors: dict[str, NDArray[np.float64]] = {}
    for name, column in texts.items():
        numbers = find_states(column, missing.texts)
        given = missing.texts if numbers else missing.texts | OPEN_CIRCUIT
        replaced = [_MISSING if is_missing(text, given) else text for text in column]
        if _MISSING in replaced:
            notes.extend(_describe_missing(column, replaced, name, rows))
        if numbers:
            replaced = [numbers.get(text.strip(), text) for text in replaced]
            notes.append(f"column {name}: {_list_states(numbers)}")
        cells[name] = replaced
        if name in units:
            found = remove_units(replaced, name, units[name], rows)
            cells[name] = found.texts
            notes.append(found.note)
            if found.factors is not None:
                factors[name] = found.factors
    return cells, factors


def _list_states(numbers: Mapping[str, str]) -> str:
    """Return how words are read: ``ON is read as 1, OFF as 0``."""
    (first, number), *others = sorted(numbers.items(), key=itemgetter(1), reverse=True)
    return ", ".join([f"{first} is read as {number}", *(f"{word} as {each}" for word, each in others)])


def _describe_missing(
    texts: Sequence[str], replaced: Sequence[str], name: str, rows: RowRange
) -> Iterator[str]:
    """Yield which words of a column are read as missing; cells that are empty or NaN are not mentioned."""
    words = {
        sample: text.strip()
        for sample, (text, cell) in enumerate(zip(texts, replaced, strict=True))
        if cell == _MISSING and text.strip().lower() not in EMPTY
    }
    if words:
        yield _make_missing_note(name, list(dict.fromkeys(words.values())), list(words), rows)


def _make_missing_note(name: str, words: Sequence[str], samples: Sequence[int], rows: RowRange) -> str:
    listed = ", ".join(words[:_LISTED]) + (", ..." if len(words) > _LISTED else "")
    where = rows.row(samples[0])
    cells = f"in {where}" if len(samples) == 1 else f"in {len(samples)} cells, the first in {where}"
    return f"column {name}: {listed} {'is' if len(words) == 1 else 'are'} read as missing {cells}"


def remove_numbers(
    column: NDArray[np.float64], name: str, missing: Collection[float], rows: RowRange
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return a column with NaN for the numbers that mean a missing value, and a note about them."""
    absent = np.isin(column, list(missing))
    if not absent.any():
        return column, ()
    words = [f"{number:.10g}" for number in dict.fromkeys(column[absent].tolist())]
    note = _make_missing_note(name, words, np.flatnonzero(absent).tolist(), rows)
    return np.where(absent, np.nan, column), (note,)


def _convert(texts: Sequence[str]) -> NDArray[np.float64] | None:
    """Convert a whole column; None if a cell is not a number."""
    try:
        numbers = np.fromiter(map(float, texts), np.float64, len(texts))
    except ValueError:
        return None
    return None if "_" in "".join(texts) else numbers  # float("1_5") is 15.0


def _convert_written(
    cells: Sequence[str], texts: Sequence[str], name: str, written: NumberFormat, rows: RowRange
) -> NDArray[np.float64]:
    """Convert a column with decimal commas or separated thousands.

    Parameters
    ----------
    cells : sequence of str
        Cells without words and units.
    texts : sequence of str
        The cells of the file, for the message.

    Raises
    ------
    RecordError
        A cell is text.
    """
    normalised = [written.normalise(text) for text in cells]
    numbers = _convert(normalised)
    if numbers is not None:
        return numbers
    sample = next(index for index, text in enumerate(normalised) if _convert([text]) is None)
    text = texts[sample].strip()
    advice = "correct the cell or leave its row out"
    if text[:1].isalpha():
        advice = join_text(f"{advice}, or, if it means a missing value, ", _give_missing(text))
    if looks_like_time(name):
        advice = (
            "write the time as a number or as 2026-11-22 14:05:03.250, or rename the column if it is not to "
            "be read as time"
        )
    place = rows.place(sample, name)
    raise RecordError(join_text(f"{place}: {reprlib.repr(text)} is not a number: ", advice))


def _give_missing(text: str) -> str:
    """Return how to declare a text as missing; a comma separates words on the command line."""
    is_short = len(text) <= _SHOWN and "," not in text
    named = name_option("missing", text) if is_short else name_option("missing", example="WORD")
    return join_text("give ", named)
