"""Text tables: a header with names, then one sample per line.

The separator and a decimal comma are inferred, because many instruments write ``0,001;1,5``. The conversion
of cells to numbers is in `number_parsing`.
"""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from itertools import islice
from operator import itemgetter
from pathlib import Path

from islands.errors import RecordError
from islands.io.records.number_parsing import find_decimal_comma, is_number, parse_numbers
from islands.io.records.table import Columns, RowRange, select

#: Separators in order of preference. The comma follows the others because it may be a decimal mark; runs of
#: blanks come last.
SEPARATORS = (";", "\t", "|", ",", " ")


@dataclass(frozen=True, slots=True, eq=False)
class DelimitedText:
    """A text table that is split into cells, which are not converted yet.

    Attributes
    ----------
    names : tuple of str
        The header.
    separator : str
        One of `SEPARATORS`.
    cells : sequence of list of str
        One list per sample, without blank lines at the end of the file.
    rows : RowRange
        Line numbers of the samples.
    """

    names: tuple[str, ...]
    separator: str
    cells: Sequence[list[str]]
    rows: RowRange

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
        """Return where a comma is read as a decimal mark, or that commas and points are mixed."""
        try:
            comma = find_decimal_comma(self._select_columns(names, self.cells), self.rows)
        except RecordError as error:
            return (str(error),)
        return (f"the comma in {comma} is read as a decimal mark",) if comma else ()

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
        The file is not UTF-8, is empty, has no header, has no samples, or a quote in it is never closed.
    """
    # Universal newlines; str.splitlines would also split at characters that editors do not count as line
    # ends.
    lines = list(StringIO(_decode(path), newline=None))
    top = next((index for index, line in enumerate(lines) if line.strip()), None)
    if top is None:
        raise RecordError(f"{path.name} is empty: a record has a header with names and one line per sample")
    lines[top] = lines[top].lstrip("#")  # numpy.savetxt writes its header as a comment
    filled = (line for line in lines[top + 1 :] if line.strip())
    separator = _infer_separator(lines[top], list(islice(filled, 5)))
    reader = csv.reader(_collapse_blanks(lines[top:], separator), delimiter=separator, strict=True)
    try:
        rows = [(top + reader.line_num, cells) for cells in reader]
    except csv.Error as error:
        raise RecordError(
            f"{path.name}, line {top + reader.line_num}: {error}; is a quote never closed?"
        ) from error
    while len(rows) > 1 and not any(cell.strip() for cell in rows[-1][1]):
        rows.pop()
    (_, header), samples = rows[0], rows[1:]
    names = tuple(name.strip() for name in header)
    _check_header(names, path.name, top + 1)
    if not samples:
        raise RecordError(f"{path.name} has a header in line {top + 1} but no samples below it")
    where = RowRange(path.name, "line", [number for number, _ in samples])
    return DelimitedText(names, separator, [cells for _, cells in samples], where)


def _decode(path: Path) -> str:
    content = path.read_bytes()
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise RecordError(
            f"{path.name}, line {line}: byte 0x{content[error.start]:02x} at position {error.start} is not "
            "UTF-8: save the file as UTF-8"
        ) from error


def _collapse_blanks(lines: Sequence[str], separator: str) -> Sequence[str]:
    """Replace every run of blanks by a single blank if the separator is a blank."""
    return [" ".join(line.split()) for line in lines] if separator == " " else lines


def _infer_separator(header: str, first: Sequence[str]) -> str:
    """Infer the separator.

    It must split the header. A separator that splits the first lines into the same number of cells is
    preferred.
    """

    def count_cells(line: str, separator: str) -> int:
        return len(next(csv.reader(_collapse_blanks([line], separator), delimiter=separator), []))

    blank = not any(mark in header for mark in ";|,")  # "t, u" is separated by its comma
    usable = [mark for mark in SEPARATORS if count_cells(header, mark) > 1 and (mark != " " or blank)]
    agreeing = (
        mark for mark in usable if all(count_cells(line, mark) == count_cells(header, mark) for line in first)
    )
    return next(agreeing, usable[0] if usable else ",")


def _check_header(names: Sequence[str], file: str, line: int) -> None:
    number = next((name for name in names if is_number(name)), None)
    if number is not None:
        raise RecordError(
            f"{file}, line {line} contains the number {number} instead of a name: add a header line, "
            "for example t_s,u_V,y_um"
        )
