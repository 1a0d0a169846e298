"""Text tables: a header with names, then one sample per line.

Encoding, start of the table, separator and decimal comma are inferred, because instruments write them in many
ways. `text_encoding`, `table_start` and `number_parsing` do that; a preview states what was inferred.
"""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from operator import itemgetter
from pathlib import Path

from islands.errors import RecordError
from islands.io.records.table import Columns, RowRange, select
from islands.io.records.text.number_parsing import find_decimal_comma, parse_numbers
from islands.io.records.text.table_start import TableStart, collapse_blanks, find_table
from islands.io.records.text.text_encoding import decode


@dataclass(frozen=True, slots=True, eq=False)
class DelimitedText:
    """A text table that is split into cells, which are not converted yet.

    Attributes
    ----------
    names : tuple of str
        The header.
    separator : str
        See `islands.io.records.text.table_start`.
    cells : sequence of list of str
        One list per sample, without blank lines at the end of the file.
    rows : RowRange
        Line numbers of the samples.
    notes : tuple of str
        What was inferred about the file as a whole.
    """

    names: tuple[str, ...]
    separator: str
    cells: Sequence[list[str]]
    rows: RowRange
    notes: tuple[str, ...] = ()

    def stated(self, structure: str) -> Mapping[str, float]:  # noqa: ARG002
        """Return an empty mapping: a text table cannot state a sampling time."""
        return {}

    def read(self, names: Sequence[str], rows: slice | None) -> Columns:
        """Convert the named columns over the selected rows; see `islands.io.records.table.Table`."""
        chosen = select(rows, len(self.cells), self.rows.file)
        kept = slice(chosen.start, chosen.stop)
        cells, where = self.cells[kept], RowRange(self.rows.file, "line", self.rows.numbers[kept])
        self._check_widths(cells, where)
        texts = self._select_columns(names, cells)
        return Columns(where, parse_numbers(texts, where), chosen.start)

    def remarks(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return what was inferred: of the file, and a decimal comma, or that commas and points are mixed."""
        try:
            comma = find_decimal_comma(self._select_columns(names, self.cells), self.rows)
        except RecordError as error:
            return (*self.notes, str(error))
        return (*self.notes, *([f"the comma in {comma} is read as a decimal mark"] if comma else []))

    def _select_columns(self, names: Sequence[str], cells: Sequence[list[str]]) -> dict[str, list[str]]:
        places = {name: place for place, name in enumerate(self.names)}
        return {name: list(map(itemgetter(places[name]), cells)) for name in names}

    def _check_widths(self, cells: Sequence[list[str]], rows: RowRange) -> None:
        width = len(self.names)
        if set(map(len, cells)) <= {width}:
            return
        sample = next(index for index, row in enumerate(cells) if len(row) != width)
        found = len(cells[sample])
        if not any(cells[sample]):
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


def read_delimited(path: Path) -> DelimitedText:
    """Split a text table into cells.

    Raises
    ------
    RecordError
        The file is not text, is empty, has no header, has no samples, or a quote in it is never closed.
    """
    text, encoding = decode(path.read_bytes(), path.name)
    # Universal newlines; str.splitlines would also split at characters that editors do not count as line
    # ends.
    lines = list(StringIO(text, newline=None))
    if not any(line.strip() for line in lines):
        raise RecordError(f"{path.name} is empty: a record has a header with names and one line per sample")
    start = find_table(lines, path.name)
    below = (collapse_blanks(line, start.separator) for line in lines[start.first :])
    reader = csv.reader(below, delimiter=start.separator, strict=True)
    try:
        rows = [(start.first + reader.line_num, cells) for cells in reader]
    except csv.Error as error:
        raise RecordError(
            f"{path.name}, line {start.first + reader.line_num}: {error}; is a quote never closed?"
        ) from error
    while rows and not any(cell.strip() for cell in rows[-1][1]):
        rows.pop()
    if not rows:
        raise RecordError(f"{path.name} has a header in line {start.header + 1} but no samples below it")
    where = RowRange(path.name, "line", [number for number, _ in rows])
    notes = _list_notes(path.name, encoding, start)
    return DelimitedText(start.names, start.separator, [cells for _, cells in rows], where, notes)


def _list_notes(file: str, encoding: str, start: TableStart) -> tuple[str, ...]:
    """Return what was inferred about the file as a whole."""
    notes = [f"{file} is not UTF-8 and is read as {encoding}"] if encoding else []
    if start.described:
        notes.append(f"the header of {file} is line {start.header + 1}; the lines above are ignored")
    if start.has_units:
        notes.append(f"line {start.first} of {file} is read as the units of the columns")
    return tuple(notes)
