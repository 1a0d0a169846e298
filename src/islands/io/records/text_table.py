"""Text tables: a header with names, then one sample per line. Only the dialect is decided here.

The separator and a decimal comma are inferred, since half of the world's instruments write ``0,001;1,5``.
"""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from itertools import islice
from operator import itemgetter
from pathlib import Path

from islands.errors import RecordError
from islands.io.records.number_parsing import decimal_comma, is_number, parse_numbers
from islands.io.records.table import Columns, RowRange, select

#: A comma stands behind the others, as it may be a decimal mark; blanks, in runs, come last.
SEPARATORS = (";", "\t", "|", ",", " ")


@dataclass(frozen=True, slots=True, eq=False)
class DelimitedText:
    """A text table whose cells are split and not yet converted.

    Attributes
    ----------
    names : tuple of str
        The header.
    separator : str
        One of `SEPARATORS`.
    cells : sequence of list of str
        One list per sample, without blank lines at the end of the file.
    rows : RowRange
        The samples' lines.
    """

    names: tuple[str, ...]
    separator: str
    cells: Sequence[list[str]]
    rows: RowRange

    def stated(self, structure: str) -> Mapping[str, float]:  # noqa: ARG002
        """Return nothing: a text table has no place for a sampling time."""
        return {}

    def read(self, names: Sequence[str], rows: slice | None) -> Columns:
        """Convert the named columns over the selected rows; see `islands.io.records.table.Table`."""
        chosen = select(rows, len(self.cells), self.rows.file)
        kept = slice(chosen.start, chosen.stop)
        cells, where = self.cells[kept], RowRange(self.rows.file, "line", self.rows.numbers[kept])
        self._refuse_ragged(cells, where)
        texts = self._texts(names, cells)
        return Columns(where, parse_numbers(texts, where), chosen.start)

    def remarks(self, names: Sequence[str]) -> tuple[str, ...]:
        """Say where a comma is taken for a decimal mark, or that points stand beside it."""
        try:
            comma = decimal_comma(self._texts(names, self.cells), self.rows)
        except RecordError as error:
            return (str(error),)
        return (f"the comma in {comma} is read as a decimal mark",) if comma else ()

    def _texts(self, names: Sequence[str], cells: Sequence[list[str]]) -> dict[str, list[str]]:
        places = {name: place for place, name in enumerate(self.names)}
        return {name: list(map(itemgetter(places[name]), cells)) for name in names}

    def _refuse_ragged(self, cells: Sequence[list[str]], rows: RowRange) -> None:
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
            advice = "delete what follows the last column"
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
    # Universal newlines; str.splitlines would also break lines at characters that no editor counts.
    lines = list(StringIO(_decoded(path), newline=None))
    top = next((index for index, line in enumerate(lines) if line.strip()), None)
    if top is None:
        raise RecordError(f"{path.name} is empty: a record is a header with names and a line per sample")
    lines[top] = lines[top].lstrip("#")  # numpy.savetxt writes its header as a comment
    filled = (line for line in lines[top + 1 :] if line.strip())
    separator = _separator(lines[top], list(islice(filled, 5)))
    reader = csv.reader(_spaced(lines[top:], separator), delimiter=separator, strict=True)
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
    _refuse_numbers_as_names(names, path.name, top + 1)
    if not samples:
        raise RecordError(f"{path.name} has a header in line {top + 1} and not a single sample below it")
    where = RowRange(path.name, "line", [number for number, _ in samples])
    return DelimitedText(names, separator, [cells for _, cells in samples], where)


def _decoded(path: Path) -> str:
    content = path.read_bytes()
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise RecordError(
            f"{path.name}, line {line}: byte 0x{content[error.start]:02x} at position {error.start} is not "
            "UTF-8: save the file as UTF-8"
        ) from error


def _spaced(lines: Sequence[str], separator: str) -> Sequence[str]:
    """Make every run of blanks a single one where blanks separate."""
    return [" ".join(line.split()) for line in lines] if separator == " " else lines


def _separator(header: str, first: Sequence[str]) -> str:
    """Infer the separator: it splits the header, and the first lines into as many cells where possible."""

    def cells(line: str, separator: str) -> int:
        return len(next(csv.reader(_spaced([line], separator), delimiter=separator), []))

    blank = not any(mark in header for mark in ";|,")  # "t, u" is separated by its comma
    usable = [mark for mark in SEPARATORS if cells(header, mark) > 1 and (mark != " " or blank)]
    agreeing = (mark for mark in usable if all(cells(line, mark) == cells(header, mark) for line in first))
    return next(agreeing, usable[0] if usable else ",")


def _refuse_numbers_as_names(names: Sequence[str], file: str, line: int) -> None:
    number = next((name for name in names if is_number(name)), None)
    if number is not None:
        raise RecordError(
            f"{file}, line {line} holds the number {number} where names are expected: add a header line, "
            "for example t_s,u_V,y_um"
        )
