"""Start of a table in a text file: its separator, the lines before it, its header and its row of units."""

import csv
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain, islice

from islands.errors import RecordError, name_option
from islands.records.channel_names import is_unit, spell_unit
from islands.records.reading.column_names import append_unit, number_column
from islands.records.reading.formats.text.missing_words import EMPTY, is_missing, parse_words
from islands.records.reading.formats.text.number_format import is_number
from islands.records.reading.formats.text.quantities import split_quantity
from islands.records.reading.formats.text.states import is_state
from islands.records.reading.formats.text.time_stamps import kind_of
from islands.records.reading.options import DEFAULT_READING, ReadingOptions

#: Separators in order of preference. The comma follows the others because it may be a decimal mark; runs of
#: blanks come last.
SEPARATORS = (";", "\t", "|", ",", " ")

#: Characters of a cell in a message.
_SHOWN = 40

#: Marks of a comment. numpy.savetxt writes its header as a comment.
COMMENTS = "#%!"

#: Lines of samples that decide where a table starts, and lines that may precede it.
_SAMPLES, _MOST_LINES = 5, 300

#: Rows of properties between a header and the samples.
_MOST_PROPERTIES = 40

#: Names of a property that is the sampling time in seconds, in lower case.
_STEPS = ("increment", "x increment", "xincrement", "tinc", "delta_x")

#: Labels in the first cell of a row of units.
_UNIT_LABELS = ("unit", "units", "einheit", "einheiten")


@dataclass(frozen=True, slots=True)
class TableStart:
    """Start of a table.

    Attributes
    ----------
    separator : str
        One of `SEPARATORS`.
    header : int or None
        Index of the line with the names; None if the file does not contain them.
    names : tuple of str
        Names of the columns, with the units of a row of units in brackets.
    first : int
        Index of the line after the header and the units.
    described : bool
        Whether lines with a description of the measurement precede the table.
    units : int or None
        Index of the row of units; None if there is none.
    labels : tuple of str
        Cells of the header, without the units of the row of units; empty if there is no header.
    properties : int
        Number of lines directly above ``first`` with properties that are numbers.
    step : float or None
        Sampling time in seconds that these properties state.
    """

    separator: str
    header: int | None
    names: tuple[str, ...]
    first: int
    described: bool
    units: int | None
    labels: tuple[str, ...] = ()
    properties: int = 0
    step: float | None = None


def find_table(lines: Sequence[str], file: str, options: ReadingOptions = DEFAULT_READING) -> TableStart:
    """Find the header of a table.

    The header is the first line if one of the lines below is a sample with as many cells. Otherwise it is the
    line above the samples, or above their row of units, and the lines before it describe the measurement.

    Parameters
    ----------
    lines : sequence of str
        Lines of the file, of which at least one is not blank.
    file : str
        Name of the file, for messages.
    options : ReadingOptions
        Whether the table has a header, and the names if it has none.

    Raises
    ------
    RecordError
        The samples have no header, or another number of columns than names are given.
    """
    top = next(index for index, line in enumerate(lines) if line.strip())
    given = re.fullmatch(r"\ufeff?sep=(.)\s*", lines[top])  # a line for Excel
    if given:
        top = next((at for at in range(top + 1, len(lines)) if lines[at].strip()), top)
    missing = parse_words(options.missing).texts
    if not options.has_header:
        return _find_without_header(lines, top, file, options.names, missing)
    separator = _infer_separator(_uncomment(lines[top]), list(islice(_list_filled(lines, top + 1), _SAMPLES)))
    separator = given[1] if given else separator
    cells, first = _read_row(lines, top, separator)
    start = top
    # A spreadsheet fills the lines of a description up to the width of the table with empty cells.
    is_header = all(cell.strip() for cell in cells) and _fits(len(cells), lines, first, separator, missing)
    is_header = is_header and not _are_units_above(lines, first, cells, separator)
    if not is_header and (found := _find_samples(lines, top, missing)):
        separator, samples = found
        start = _find_header(lines, top, samples, separator, file)
        cells, first = _read_row(lines, start, separator)
        cells = _drop_empty_end(cells, len(_split(lines[samples], separator)))
    if first == len(lines) > start + 1:
        raise RecordError(f"{file}, line {start + 1}: is a quote never closed?")
    names = labels = tuple(name.strip() for name in cells)
    properties = _list_properties(lines, first, separator, len(names))
    samples = max([first, *(at + 1 for at in properties)])
    # Oscilloscopes separate the header from the samples by a blank line.
    samples = next((at for at in range(samples, len(lines)) if lines[at].strip()), samples)
    first, samples = samples, _skip_properties(lines, samples, separator, missing)
    rows = {at: _read_units(lines[at], separator) for at in properties}
    rows |= {at: _read_units(lines[at], separator, True) for at in range(first, samples)}
    if start > top:  # a row of units may also precede the names
        rows[start - 1] = _read_units(lines[start - 1], separator)
    units = next((at for at, row in rows.items() if len(row) == len(names)), None)
    _check_header(names, file, start + 1, units is not None)
    if units is not None:
        names = tuple(map(append_unit, names, rows[units]))
    step = _find_step(labels, [_split(lines[at], separator) for at in range(first, samples)])
    described = any(lines[at].strip() and at != units for at in range(top, start))
    return TableStart(separator, start, names, samples, described, units, labels, samples - first, step)


def _drop_empty_end(cells: list[str], width: int) -> list[str]:
    """Return the cells of a header without empty ones behind the last column of the samples."""
    return cells[:width] if not any(cell.strip() for cell in cells[width:]) else cells


def _are_units_above(lines: Sequence[str], first: int, cells: Sequence[str], separator: str) -> bool:
    """Return whether a row contains the units of the names in the line below it."""
    if first == len(lines) or len(_read_units(separator.join(cells), separator)) != len(cells):
        return False
    names = [cell.strip() for cell in _split(lines[first], separator)]
    is_names = all(names) and len(set(names)) == len(names) == len(cells)
    return is_names and all(map(is_text, names)) and not _read_units(lines[first], separator)


def _find_step(labels: Sequence[str], properties: Sequence[Sequence[str]]) -> float | None:
    """Return the sampling time in seconds that a row of properties states, as of oscilloscopes.

    The header ``X,CH1,Start,Increment`` and the row ``Sequence,Volt,-6e-3,2e-6`` belong to samples that are
    counted.
    """
    for row in properties:
        for label, cell in zip(labels, row, strict=False):
            if label.lower() in _STEPS and is_number(cell) and (step := float(cell.replace(",", "."))) > 0.0:
                return step
    return None


def _list_properties(lines: Sequence[str], first: int, separator: str, width: int) -> list[int]:
    """Return the indices of the lines between header and samples: units, types and other words."""
    found: list[int] = []
    for at in range(first, min(len(lines), first + _SAMPLES)):
        if not lines[at].strip():
            continue
        cells = _split(lines[at], separator)
        filled = [cell for cell in cells if cell.strip() == "-" or cell.strip().lower() not in EMPTY]
        if len(cells) != width or not filled or any(is_value(cell) or kind_of(cell) for cell in filled):
            return found
        found.append(at)
    return []  # the table contains text only


def _find_without_header(
    lines: Sequence[str], top: int, file: str, given: tuple[str, ...], missing: frozenset[str]
) -> TableStart:
    """Find the samples of a table whose names are given or are c1, c2, ..."""
    found = _find_samples(lines, top, missing)
    if found is None:
        raise RecordError(
            f"{file} has no lines of numbers: export the record as a table, one line per sample"
        )
    separator, samples = found
    width = len(_split(lines[samples], separator))
    names = given or tuple(map(number_column, range(width)))
    if len(names) != width:
        raise RecordError(
            f"{file}, line {samples + 1} has {width} columns, and {name_option('names')} gives "
            f"{len(names)}: name all columns in their order"
        )
    return TableStart(separator, None, names, samples, samples > top, None)


def _read_row(lines: Sequence[str], at: int, separator: str) -> tuple[list[str], int]:
    """Return the cells of the row that begins at a line, and the index of the line after it.

    A quoted cell may contain line ends.
    """
    rows = chain([_uncomment(lines[at])], (lines[below] for below in range(at + 1, len(lines))))
    reader = csv.reader((collapse_blanks(line, separator) for line in rows), delimiter=separator)
    try:
        return next(reader, []), at + reader.line_num
    except csv.Error:  # a cell exceeds the limit of the module csv
        return _split(_uncomment(lines[at]), separator), len(lines) if '"' in lines[at] else at + 1


def _uncomment(line: str) -> str:
    return line.lstrip(COMMENTS)


def _split(line: str, separator: str) -> list[str]:
    """Split a line into cells.

    A line with a cell that exceeds the limit of the module csv is one cell: another separator may fit.
    """
    try:
        return next(csv.reader([collapse_blanks(line, separator)], delimiter=separator), [])
    except csv.Error:
        return [line]


def collapse_blanks(line: str, separator: str) -> str:
    """Replace every run of blanks by a single blank if the separator is a blank."""
    return " ".join(line.split()) if separator == " " else line


def _list_filled(lines: Sequence[str], start: int) -> Iterator[str]:
    return (lines[at] for at in range(start, len(lines)) if lines[at].strip())


def _infer_separator(header: str, first: Sequence[str]) -> str:
    """Infer the separator.

    It must split the header. A separator that splits the first lines into the same number of cells is
    preferred.
    """
    blank = not any(mark in header for mark in ";|,")  # "t, u" is separated by its comma
    widths = {mark: len(_split(header, mark)) for mark in SEPARATORS}
    usable = [mark for mark in SEPARATORS if widths[mark] > 1 and (mark != " " or blank)]
    agreeing = (mark for mark in usable if all(len(_split(line, mark)) == widths[mark] for line in first))
    return next(agreeing, usable[0] if usable else ",")


def _fits(width: int, lines: Sequence[str], first: int, separator: str, missing: frozenset[str]) -> bool:
    """Return whether one of the first lines below a header is a sample with as many cells."""
    below = [_split(line, separator) for line in islice(_list_filled(lines, first), _SAMPLES)]
    return not below or any(len(cells) == width and _is_sample(cells, missing) for cells in below)


def _find_samples(
    lines: Sequence[str], top: int, missing: frozenset[str] = frozenset()
) -> tuple[str, int] | None:
    """Return the separator and the index of the first sample, None if no lines look like samples."""

    @cache
    def width(at: int, separator: str) -> int:
        """Return the number of cells of a sample; 0 if the line is none."""
        cells = _split(lines[at], separator)
        return len(cells) if _is_sample(cells, missing) else 0

    def are_samples(block: Sequence[int], separator: str) -> bool:
        first = width(block[0], separator)
        return first > 1 and all(width(at, separator) == first for at in block)

    def have_flags(block: Sequence[int], separator: str) -> bool:
        return _have_flags([_split(lines[at], separator) for at in block], missing)

    for fits in (are_samples, have_flags):
        filled = (at for at in range(top, len(lines)) if lines[at].strip())
        block = list(islice(filled, _SAMPLES))
        while block and block[0] < top + _MOST_LINES:
            for separator in SEPARATORS:
                if fits(block, separator):
                    return separator, _extend_upwards(lines, top, block[0], separator)
            block = [*block[1:], *islice(filled, 1)]
    return None


def _have_flags(rows: Sequence[Sequence[str]], missing: Collection[str]) -> bool:
    """Return whether rows are samples, apart from columns that repeat a word, such as the flags of alarms."""
    if len(rows) < _SAMPLES or len({len(cells) for cells in rows}) > 1:
        return False
    flags = set()
    for place, column in enumerate(zip(*rows, strict=True)):
        if any(is_text(cell, missing) and not is_missing(cell, missing) for cell in column):
            flags.add(place)
            if place == 0 or len(set(column)) > 1:
                return False
    kept = [[cell for place, cell in enumerate(cells) if place not in flags] for cells in rows]
    return all(len(cells) > 1 and _is_sample(cells, missing) for cells in kept)


def _extend_upwards(lines: Sequence[str], top: int, samples: int, separator: str) -> int:
    """Return the first of the lines above the samples that has numbers in the same columns.

    Instruments write properties or the word ``trace_values`` into other columns of the first samples.
    """
    cells = _split(lines[samples], separator)
    numeric = [place for place, cell in enumerate(cells) if is_number(cell)]
    while samples > top and len(numeric) > 1:
        above = _split(lines[samples - 1], separator)
        if len(above) != len(cells) or not all(is_number(above[place]) for place in numeric):
            break
        samples -= 1
    return samples


def has_samples(lines: Sequence[str], options: ReadingOptions = DEFAULT_READING) -> bool:
    """Return whether the first lines of a table contain samples."""
    missing = parse_words(options.missing).texts
    top = next((index for index, line in enumerate(lines) if line.strip()), None)
    return top is not None and _find_samples(lines, top, missing) is not None


def _is_sample(cells: Sequence[str], missing: Collection[str] = ()) -> bool:
    """Return whether the cells are numbers, time stamps, states or missing, except for one, not the first.

    A line of a description begins with text: ``Sample interval,4e-09``, ``Timeout;5``.

    Parameters
    ----------
    cells : sequence of str
    missing : collection of str
        Words of the user for a missing value, in lower case.
    """
    if not cells or is_text(cells[0], missing):
        return False
    others = islice((cell for cell in cells[1:] if not is_missing(cell) and is_text(cell, missing)), 2)
    return len(list(others)) < 2 and any(map(is_value, cells))


def is_text(cell: str, missing: Collection[str] = ()) -> bool:
    """Return whether a cell is neither a number, with or without unit, nor a time stamp, a state or empty.

    A known word for a missing value is text, because a description may begin with it. A single letter is a
    name.
    """
    word = cell.strip()
    if is_number(cell) or word.lower() in EMPTY or word.lower() in missing or kind_of(cell):
        return False
    return not ((len(word) > 1 and is_state(cell)) or split_quantity(cell))


def _skip_properties(lines: Sequence[str], first: int, separator: str, missing: frozenset[str]) -> int:
    """Return the index of the first sample below rows of properties with numbers, as of oscilloscopes.

    The first cell of such a row is text, and others are, unless it is one of several such rows:
    ``Sequence,Volt,Volt,0.1``.
    """
    if first == len(lines) or _is_sample(cells := _split(lines[first], separator), missing):
        return first
    for at in range(first, min(len(lines), first + _MOST_PROPERTIES)):
        row = _split(lines[at], separator)
        if _is_sample(row, missing) and len(row) == len(cells):
            texts = sum(is_text(cell, missing) for cell in cells)
            return at if texts > 1 or at > first + 1 else first
        if not row or len(row) != len(cells) or not is_text(row[0], missing):
            return first
    return first


def is_value(cell: str) -> bool:
    """Return whether a cell is a number, with or without unit."""
    return bool(is_number(cell) or split_quantity(cell))


def _advise_header() -> str:
    return (
        f"add a header line, for example t_s,u_V,y_um, or give {name_option('header', False)} for the names "
        f"c1, c2, ... or {name_option('names', ['a', 'b', 'c'])}"
    )


def _find_header(lines: Sequence[str], top: int, samples: int, separator: str, file: str) -> int:
    """Return the index of the header above the samples; the line above may be a row of units."""
    width = len(_split(lines[samples], separator))
    above = [at for at in range(top, samples) if lines[at].strip()]
    # The last column may be empty in all samples: a comment.
    widths = {at: len(_split(_uncomment(lines[at]), separator)) for at in above}
    fitting = [at for at in above if widths[at] in (width, width + 1)]
    if above == [top] or (fitting and fitting[0] == top and fitting[-1] != above[-1]):
        # Another number of cells, in all samples or in the first ones, is reported when they are read.
        return top
    if not fitting or fitting[-1] != above[-1]:
        raise RecordError(
            f"{file}, line {samples + 1} is the first sample, and no line above has the names of its {width} "
            f"columns: {_advise_header()}"
        )
    # The nearest line with different names; below it are rows of units, of types or of other properties.
    adjacent = [at for at, other in zip(reversed(fitting), reversed(above), strict=False) if at == other]
    rows = {at: [cell.strip() for cell in _split(_uncomment(lines[at]), separator)] for at in adjacent}
    rows = {at: _drop_empty_end(cells, width) for at, cells in rows.items()}
    named = [
        at
        for at, cells in rows.items()
        if all(cells)
        and len(set(cells)) == len(cells)
        and len(_read_units(lines[at], separator)) != len(cells)
    ]
    return named[0] if named else adjacent[0]


def _read_units(line: str, separator: str, has_numbers: bool = False) -> list[str]:
    """Return the cells of a row of units without brackets; empty if it is not such a row.

    The first cell may be a label, ``unit``, or any word if the row also has properties that are numbers,
    ``Sequence,Volt,0.1``: these are no units.
    """
    cells = [spell_unit(cell.strip().strip("[]()").strip()) for cell in _split(_uncomment(line), separator)]
    if cells and cells[0].lower().rstrip(":") in _UNIT_LABELS:
        cells[0] = ""
    if has_numbers:
        cells = ["" if is_number(cell) or not place else cell for place, cell in enumerate(cells)]
    units = [cell for cell in cells if cell not in ("", "-")]
    return cells if units and all(map(is_unit, units)) else []


def _check_header(names: Sequence[str], file: str, line: int, has_units: bool) -> None:
    """Refuse a line of numbers as a header. Numbers of channels are names: ``x-axis,1,2``."""
    numbers = [name for name in names if is_number(name)]
    channels = len(numbers) < len(names) and all(name.isdigit() and len(name) < 4 for name in numbers)
    if numbers and not has_units and not (channels and not _is_sample(names)):
        raise RecordError(
            f"{file}, line {line} contains the number {numbers[0][:_SHOWN]} instead of a name: "
            f"{_advise_header()}"
        )
