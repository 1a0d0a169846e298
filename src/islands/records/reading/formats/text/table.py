"""Text tables: a header with names, then one sample per line.

Encoding, start of the table, separator and decimal comma are inferred: instruments write them in many ways.
`encoding`, `table_start`, `other_rows` and `number_parsing` do that; a preview states what was inferred.
"""

import csv
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import StringIO
from itertools import islice
from operator import itemgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.records.reading.column_names import append_unit, find_column, time_column
from islands.records.reading.formats.text.encoding import decode
from islands.records.reading.formats.text.long_table import describe_long_table
from islands.records.reading.formats.text.milliseconds import append_milliseconds, find_milliseconds
from islands.records.reading.formats.text.missing_words import MissingWords, is_missing, parse_words
from islands.records.reading.formats.text.number_parsing import describe_numbers, parse_numbers
from islands.records.reading.formats.text.other_rows import describe_left_out, keep_samples
from islands.records.reading.formats.text.quantities import find_unit
from islands.records.reading.formats.text.table_start import TableStart, collapse_blanks, find_table
from islands.records.reading.formats.text.time_stamps import (
    DATE_ONLY,
    TIME_ONLY,
    find_kind,
    parse_stamps,
)
from islands.records.reading.formats.text.traces import TraceTable, is_trace, read_trace
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.size_limits import (
    MOST_CHARACTERS,
    MOST_LINE,
    check_cell,
    check_column_count,
    check_line,
    check_name,
)
from islands.records.reading.table import Columns, RowRange, select

#: Samples that decide whether a column contains time stamps, and whether its times decrease.
_DECIDING = 20

#: Samples that determine that times decrease, at least.
_LEAST_DECREASING = 12

#: Name of a column of time stamps that the header leaves empty.
_CLOCK_NAME = "time"

#: Seconds.
_HALF_DAY = 43_200.0


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class DelimitedText:
    """A text table that is split into cells, which are not converted yet.

    Attributes
    ----------
    names : tuple of str
        The header.
    separator : str
        See `islands.records.reading.formats.text.table_start`.
    cells : sequence of list of str
        One list per sample, without blank lines at the end of the file.
    rows : RowRange
        Line numbers of the samples.
    clocks : mapping of str to str
        Columns of time stamps. The value is the column of their dates, empty if there is none.
    options : ReadingOptions
        Decimal mark, order of dates, time zone.
    notes : tuple of str
        What was inferred about the file as a whole.
    units : mapping of str to str
        Units of the cells of the columns that have them.
    starts : tuple of int
        Samples that follow a repeated header.
    left_out : tuple of str
        Which rows are not samples.
    others : str
        Other tables of the file; see `islands.records.reading.table.Table`.
    step : float or None
        Sampling time in seconds that a property below the header states.
    """

    names: tuple[str, ...]
    separator: str
    cells: Sequence[list[str]]
    rows: RowRange
    clocks: Mapping[str, str]
    options: ReadingOptions = DEFAULT_READING
    notes: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    starts: tuple[int, ...] = ()
    left_out: tuple[str, ...] = ()
    others: str = ""
    step: float | None = None
    # Both are found once: a search per column would take the square of the time.
    _places: Mapping[str, int] = field(init=False, repr=False)
    _irregular: NDArray[np.int64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        widths = np.fromiter(map(len, self.cells), np.int64, len(self.cells))
        object.__setattr__(self, "_places", {name: place for place, name in enumerate(self.names)})
        object.__setattr__(self, "_irregular", np.flatnonzero(widths != len(self.names)))

    def stated(self, structure: str) -> Mapping[str, float]:  # noqa: ARG002
        """Return the sampling time that a property below the header states, as oscilloscopes write it."""
        return {} if self.step is None else {"increment": self.step}

    def read(self, names: Sequence[str], rows: slice | None) -> Columns:
        """Convert the named columns over the selected rows; see `islands.records.reading.table.Table`."""
        chosen = select(rows, len(self.cells), self.rows.file)
        self._check_widths(chosen)
        kept = slice(chosen.start, chosen.stop)
        cells, where = self.cells[kept], RowRange(self.rows.file, self.rows.counted, self.rows.numbers[kept])
        texts = self._select_columns([name for name in names if name not in self.clocks], cells)
        parsed = parse_numbers(
            *(texts, where, self.options.decimal_mark, self.separator, self._missing, self.units)
        )
        numbers = parsed.numbers
        for name in names:
            if name in self.clocks:
                stamps = self._join_date(name, cells)
                numbers[name] = parse_stamps(
                    *(stamps, name, where, self.options.dates, self.options.timezone, self._missing.texts)
                )
        clocks = frozenset(name for name in names if name in self.clocks)
        starts = tuple(at - chosen.start for at in self.starts if chosen.start < at < chosen.stop)
        return Columns(where, numbers, chosen.start, clocks, starts, (*self.left_out, *parsed.notes))

    def remarks(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return what was inferred: of the file, and how numbers are written, or that it is uncertain."""
        long = describe_long_table(self.names, self.cells, _find_time(self), self._missing.texts)
        notes = (*self.notes, *([long] if long else []))
        numeric = [name for name in names if name not in self.clocks]
        try:
            note = describe_numbers(
                self._select_columns(numeric, self.cells),
                self.rows,
                self.options.decimal_mark,
                self.separator,
                self._missing,
                self.units,
            )
        except RecordError as error:
            return (*notes, error.message)
        return (*notes, *([note] if note else []))

    @property
    def _missing(self) -> MissingWords:
        return parse_words(self.options.missing)

    def _join_date(self, name: str, cells: Sequence[list[str]]) -> list[str]:
        """Return the time stamps of a column, each with the date in another column if there is one."""
        times = self._select_columns([name], cells)[name]
        if not (source := self.clocks[name]):
            return times
        dates = self._select_columns([source], cells)[source]
        missing = self._missing.texts
        return [
            "" if is_missing(time, missing) or is_missing(day, missing) else f"{day.strip()} {time.strip()}"
            for day, time in zip(dates, times, strict=True)
        ]

    def _select_columns(self, names: Sequence[str], cells: Sequence[list[str]]) -> dict[str, list[str]]:
        return {name: list(map(itemgetter(self._places[name]), cells)) for name in names}

    def _check_widths(self, chosen: range) -> None:
        place = int(np.searchsorted(self._irregular, chosen.start))
        if place == len(self._irregular) or (sample := int(self._irregular[place])) >= chosen.stop:
            return
        width, rows = len(self.names), self.rows
        found = len(self.cells[sample])
        if not any(self.cells[sample]):
            raise RecordError(
                f"{rows.file}, {rows.row(sample)} is blank: delete it, or cut the file there if it holds "
                "several recordings and pass them as segments (islands.join)"
            )
        if found < width:
            name = self.names[found]
            advice = "every channel needs a cell in every line: complete the line or leave it out"
        else:
            name = self.names[-1]
            advice = "delete the cells after the last column"
            if self.separator == ",":
                advice += ", or, if it is a decimal comma, save with ';' between the columns or with points"
        raise RecordError(
            f"{rows.place(sample, name)}: the line has {found} cells for {width} columns; {advice}"
        )


def read_delimited(path: Path, options: ReadingOptions = DEFAULT_READING) -> DelimitedText:
    """Split a text table into cells.

    Raises
    ------
    RecordError
        The file is not text, is empty, has no header, has no samples, exceeds a limit of
        `islands.records.reading.size_limits`, or a quote in it is never closed.
    """
    text, encoding = decode(path.read_bytes(), path.name)
    # Universal newlines; str.splitlines would also split at characters that editors do not count as line
    # ends.
    lines = list(StringIO(text, newline=None))
    table = split_table(lines, path.name, "line", options)
    if not encoding:
        return table
    return replace(table, notes=(f"{path.name} is not UTF-8 and is read as {encoding}", *table.notes))


def split_table(lines: Sequence[str], file: str, counted: str, options: ReadingOptions) -> DelimitedText:
    """Split the lines of a table into cells.

    Parameters
    ----------
    lines : sequence of str
        The lines with their ends.
    file, counted : str
        File name, and ``line`` or ``row``, for messages.

    Raises
    ------
    RecordError
        There is no table, a line, a name or a cell is too long, or a quote is never closed.
    """
    if max(map(len, lines), default=0) > MOST_LINE:
        number, length = next((at, len(line)) for at, line in enumerate(lines, 1) if len(line) > MOST_LINE)
        check_line(length, f"{file}, {counted} {number}")
    if not any(line.strip() for line in lines):
        raise RecordError(f"{file} is empty: a record has a header with names and one line per sample")
    if is_trace(lines):
        return _make_trace_table(read_trace(lines, file), file, counted, options)
    start = find_table(lines, file, options)
    check_column_count(start.names, file)
    for name in start.names:
        check_name(name, f"{file}, {counted} {start.first if start.header is None else start.header + 1}")
    numbers, rows = _read_rows(lines, start, file, counted)
    if not rows:
        header = "no" if start.header is None else f"a header in {counted} {start.header + 1} but no"
        raise RecordError(f"{file} has {header} samples{' below it' if start.header is not None else ''}")
    missing = parse_words(options.missing).texts
    kept = keep_samples(numbers, rows, start.labels, counted, missing)
    left_out = kept.notes
    if start.properties > 1 or (start.properties and start.units != start.first - 1):
        above = describe_left_out(
            counted, start.first - start.properties + 1, start.first, "below the header"
        )
        left_out = (above, *left_out)
    names, cells = _trim(start.names, kept.cells)
    names, notes = _name_clock(names, cells, missing)
    left_out = (*left_out, *notes)
    clocks = _find_clocks(names, cells, missing)
    if milliseconds := find_milliseconds(names, cells, clocks, missing):
        (clock,) = clocks
        left_out = (*left_out, f"column {milliseconds} is read as the milliseconds of column {clock}")
        names, cells = _join_milliseconds(names, cells, names.index(clock), names.index(milliseconds))
    units = _find_units(names, cells, clocks, missing)
    titles = {name: append_unit(name, unit) for name, unit in units.items()}
    table = DelimitedText(
        tuple(titles.get(name, name) for name in names),
        start.separator,
        cells,
        RowRange(file, counted, kept.numbers),
        clocks,
        options,
        _list_notes(file, start, counted),
        {titles[name]: unit for name, unit in units.items()},
        kept.starts,
        left_out,
        step=start.step,
    )
    return _order_rows(table) if _has_newest_first(table) else table


def _find_time(table: DelimitedText) -> str | None:
    """Return the time column; None if there is none, or several may be the time."""
    given = table.options.time
    if given is not None:
        found = find_column(given, table.names)
        return found if found in table.names else None
    try:
        return time_column(table.names, table.rows.file, clocks=table.clocks)
    except RecordError:
        return None  # it is raised when the columns are read


def _has_newest_first(table: DelimitedText) -> bool:
    """Return whether the time decreases in the first and in the last rows.

    Times of day without a date that decrease are read as those of the days before midnight.
    """
    count, time = len(table.cells), _find_time(table)
    if table.starts or count < _LEAST_DECREASING or time is None:
        return False
    try:
        parts = [slice(0, min(count, _DECIDING)), slice(max(0, count - _DECIDING), count)]
        steps = np.concatenate([np.diff(table.read((time,), part).numbers[time]) for part in parts])
    except RecordError:
        return False  # it is raised when the columns are read
    if table.clocks.get(time) == "" and (steps > _HALF_DAY).all():
        return _is_time_of_day(table, time)
    return bool((steps < 0).all())


def _is_time_of_day(table: DelimitedText, time: str) -> bool:
    place = table.names.index(time)
    return find_kind([row[place] for row in table.cells[:_DECIDING]], frozenset()) == TIME_ONLY


def _order_rows(table: DelimitedText) -> DelimitedText:
    rows = RowRange(table.rows.file, table.rows.counted, table.rows.numbers[::-1])
    note = "the rows are read from the last to the first, because their time decreases"
    return replace(table, cells=table.cells[::-1], rows=rows, left_out=(*table.left_out, note))


def _make_trace_table(trace: TraceTable, file: str, counted: str, options: ReadingOptions) -> DelimitedText:
    for name in trace.names:
        check_name(name, file)
    note = f"{file} is a trace of a controller; its times are read in ms (option time_unit overrules it)"
    rows = RowRange(file, counted, trace.numbers)
    return DelimitedText(trace.names, ";", trace.cells, rows, {}, options, left_out=(note,))


def _read_rows(
    lines: Sequence[str], start: TableStart, file: str, counted: str
) -> tuple["array[int]", list[list[str]]]:
    """Return the line numbers and the cells of all samples, without blank lines at the end."""
    below: Iterable[str] = islice(lines, start.first, None)
    if start.separator == " ":
        below = (collapse_blanks(line, start.separator) for line in below)
    reader = csv.reader(below, delimiter=start.separator, strict=True)
    numbers = array("q")
    rows: list[list[str]] = []
    blank: list[str] = []  # one for all: a file may consist of blank lines
    ended = start.first
    try:
        for cells in reader:
            ended = start.first + reader.line_num
            numbers.append(ended)
            rows.append(cells or blank)
            longest = max(map(len, cells), default=0)
            if longest > MOST_CHARACTERS:
                place = _find_longest(cells)
                check_cell(longest, f"{file}, {counted} {ended}, column {_name(start, place)}")
    except csv.Error as error:
        at = start.first + reader.line_num
        if "field limit" in str(error):
            # In a row of several lines, the cell is the last one of the first line.
            parts = lines[ended].split(start.separator)
            place = _find_longest(parts) if at == ended + 1 else len(parts) - 1
            length = len(parts[place]) + sum(map(len, lines[ended + 1 : at]))
            check_cell(length, f"{file}, {counted} {ended + 1}, column {_name(start, place)}")
        raise RecordError(f"{file}, {counted} {at}: {error}; is a quote never closed?") from error
    while rows and not any(cell.strip() for cell in rows[-1]):
        rows.pop()
        numbers.pop()
    return numbers, rows


def _find_longest(cells: Sequence[str]) -> int:
    return max(range(len(cells)), key=lambda place: len(cells[place]))


def _name(start: TableStart, place: int) -> str:
    """Return the name of a column, or its number from 1 if it has none."""
    return start.names[place] if place < len(start.names) else str(place + 1)


def _trim(names: tuple[str, ...], cells: list[list[str]]) -> tuple[tuple[str, ...], list[list[str]]]:
    """Remove empty columns at the end: cells that no line has, and cells behind the last name."""
    widths = {len(row) for row in cells if row}
    if len(widths) != 1:
        return names, cells
    found, width = widths.pop(), len(names)
    if 1 < found < width:
        return names[:found], cells
    if found > width and not any(any(row[width:]) for row in cells):
        return names, [row[:width] for row in cells]
    return names, cells


def _join_milliseconds(
    names: tuple[str, ...], cells: Sequence[list[str]], stamp: int, milliseconds: int
) -> tuple[tuple[str, ...], list[list[str]]]:
    """Append the milliseconds to the time stamps, and remove their column."""
    joined = [
        [
            append_milliseconds(cell, row[milliseconds]) if place == stamp else cell
            for place, cell in enumerate(row)
            if place != milliseconds
        ]
        for row in cells
    ]
    return (*names[:milliseconds], *names[milliseconds + 1 :]), joined


def _find_units(
    names: Sequence[str], cells: Sequence[list[str]], clocks: Mapping[str, str], missing: frozenset[str]
) -> dict[str, str]:
    """Return the units of the cells of all columns that have such cells."""
    stamps = {*clocks, *clocks.values()}
    found = {
        name: find_unit((row[place] for row in cells if len(row) > place), missing)
        for place, name in enumerate(names)
        if name and name not in stamps
    }
    return {name: unit for name, unit in found.items() if unit}


def _name_clock(
    names: tuple[str, ...], cells: Sequence[list[str]], missing: frozenset[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Name the only column of time stamps without a name, and state it.

    Loggers leave the cell above the time empty, as does a data frame that is indexed by time.
    """
    first = list(islice(cells, _DECIDING))
    unnamed = [
        place
        for place, name in enumerate(names)
        if not name and find_kind([row[place] for row in first if len(row) > place], missing)
    ]
    if len(unnamed) != 1 or _CLOCK_NAME in names:
        return names, ()
    (place,) = unnamed
    note = f"column {place + 1} has no name and contains time stamps: it is read as column {_CLOCK_NAME}"
    return (*names[:place], _CLOCK_NAME, *names[place + 1 :]), (note,)


def _find_clocks(names: Sequence[str], cells: Sequence[list[str]], missing: frozenset[str]) -> dict[str, str]:
    """Return the columns of time stamps with the columns of their dates."""
    first = list(islice(cells, _DECIDING))
    kinds = {
        name: find_kind([row[place] for row in first if len(row) > place], missing)
        for place, name in enumerate(names)
        if name
    }
    dates, times = ([name for name, kind in kinds.items() if kind == each] for each in (DATE_ONLY, TIME_ONLY))
    date = dates[0] if len(dates) == len(times) == 1 else ""
    return {name: date if kind == TIME_ONLY else "" for name, kind in kinds.items() if kind and name != date}


def _list_notes(file: str, start: TableStart, counted: str) -> tuple[str, ...]:
    """Return what was inferred about the file as a whole."""
    notes = []
    if start.described:
        what, at = ("table", start.first) if start.header is None else ("header", start.header)
        notes.append(f"the {what} of {file} is {counted} {at + 1}; the lines above are ignored")
    if start.units is not None:
        notes.append(f"{counted} {start.units + 1} of {file} is read as the units of the columns")
    if start.step is not None:
        notes.append(f"the sampling time of {start.step:.6g} s is the increment below the header of {file}")
    return tuple(notes)
