"""Workbooks of Excel (.xlsx, .xlsm), read by openpyxl (extra `excel`). A sheet is read like a text table."""

import csv
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import date, datetime, time, timedelta
from io import StringIO
from pathlib import Path
from typing import Any

from islands.distribution import describe_missing_extra
from islands.errors import RecordError, join_text, name_option, suggest
from islands.records.reading.formats.text.table import DelimitedText, split_table
from islands.records.reading.formats.text.table_start import has_samples
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.size_limits import (
    MOST_CELLS,
    MOST_COLUMNS,
    check_archive,
    check_column_count,
    check_unpacked,
)

#: Rows of a sheet of Excel.
_MOST_ROWS = 2**20

#: Exceptions of openpyxl and the standard library for damaged workbooks.
_DAMAGED = (
    LookupError,
    ArithmeticError,
    ValueError,
    TypeError,
    AttributeError,
    OSError,
    EOFError,
    SyntaxError,
    NotImplementedError,
    zipfile.BadZipFile,
    zlib.error,
)


def read_workbook(path: Path, options: ReadingOptions = DEFAULT_READING) -> DelimitedText:
    """Read a sheet of a workbook: the given one, or the first that contains a table.

    Formulas have the values that the workbook stores.

    Raises
    ------
    RecordError
        The file is not a workbook or is damaged, has no such sheet, no sheet contains a table, or openpyxl is
        not installed.
    """
    file = path.name
    try:
        from openpyxl import load_workbook  # noqa: PLC0415
        from openpyxl.utils.exceptions import InvalidFileException  # noqa: PLC0415
    except ImportError as error:
        raise RecordError(f"{describe_missing_extra(file, 'excel')}; or save the sheet as CSV") from error
    if not zipfile.is_zipfile(path):
        raise RecordError(f"{file} is not a workbook of the format XLSX: save it again as XLSX or as CSV")
    try:
        check_archive(path)
        # The library refuses a path with another suffix.
        stream = path.open("rb")
        try:
            book = load_workbook(stream, read_only=True, data_only=True, keep_links=False)
            names = [sheet.title for sheet in book.worksheets]
            check_column_count(names, file)
            chosen = _choose_sheets(names, options.sheet, file)
            name, lines = _find_table(((name, book[name]) for name in chosen), file, options)
            if not lines and options.sheet is not None:
                found = ((other, _list_lines(book[other], file)) for other in names if other != options.sheet)
                tables = [other for other, rows in found if has_samples(rows, options)]
                raise _make_sheet_error(file, options.sheet, tables)
        finally:
            stream.close()
    except (*_DAMAGED, InvalidFileException) as error:
        raise RecordError(f"{file} is damaged or not a workbook ({error}): save it again") from error
    if not lines:
        raise RecordError(
            join_text(
                f"{file} has no sheet with a table of numbers; its sheets are {', '.join(names)}: name the "
                "sheet by ",
                name_option("sheet"),
            )
        )
    others = [other for other in names if other != name]
    table = split_table(lines, f"{file}, sheet {name}", "row", options)
    if not others:
        return table
    listed = join_text(
        f"the sheet {name} of {file} is read; other sheets (", name_option("sheet"), f"): {', '.join(others)}"
    )
    return replace(table, notes=(listed, *table.notes), others=listed)


def _choose_sheets(names: Sequence[str], sheet: str | None, file: str) -> Sequence[str]:
    """Return the sheets that may contain the table."""
    if sheet is None:
        return names
    if sheet not in names:
        raise RecordError(
            f"{file} has no sheet {sheet}; its sheets are {', '.join(names)}{suggest(sheet, names)}"
        )
    return [sheet]


def _make_sheet_error(file: str, sheet: str, tables: Sequence[str]) -> RecordError:
    found = f"sheets with one are {', '.join(tables)}" if tables else "no other sheet has one"
    return RecordError(f"the sheet {sheet} of {file} has no table of numbers; {found}")


def _find_table(
    sheets: Iterator[tuple[str, Any]], file: str, options: ReadingOptions
) -> tuple[str, list[str]]:
    """Return the name and the lines of the first sheet with a table; the lines are empty if none has one."""
    name = ""
    for name, sheet in sheets:
        lines = _list_lines(sheet, file)
        if has_samples(lines, options):
            return name, lines
    return name, []


def _list_lines(sheet: Any, file: str) -> list[str]:
    """Return the rows of a sheet as lines with tabulators between the cells.

    Cells and rows that a file leaves out are counted too: one cell can be in any row and column.
    """
    sheet.reset_dimensions()  # the stated size may be wrong
    lines = []
    width = characters = 0
    rows: list[list[str]] = []
    for row in sheet.iter_rows(values_only=True):
        rows.append([_as_text(value) for value in row])
        width = max(width, len(row))
        # Cells of a workbook share their texts, which are written out here.
        characters += sum(map(len, rows[-1]))
        check_unpacked(characters, file)
        if width > MOST_COLUMNS or len(rows) * max(width, 1) > MOST_CELLS or len(rows) > _MOST_ROWS:
            raise RecordError(
                f"{file} has a sheet of more than {len(rows) - 1} rows and {width} columns, too many for a "
                "record: save only its cells as CSV"
            )
    for row in rows:
        stream = StringIO()
        csv.writer(stream, delimiter="\t", lineterminator="\n").writerow([*row, *[""] * (width - len(row))])
        lines.append(stream.getvalue())
    return lines


def _as_text(value: Any) -> str:
    match value:
        case None:
            return ""
        case bool():
            return str(int(value))
        case datetime():
            return value.isoformat(" ")
        case date() | time():
            return value.isoformat()
        case timedelta():
            return repr(value.total_seconds())
        case str():
            return " ".join(value.split())
        case _:
            return repr(value)
