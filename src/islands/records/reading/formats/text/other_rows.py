"""Rows of a text table that are not samples: a header that a logger repeats, and a footer."""

from array import array
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from islands.records.reading.formats.text.missing_words import EMPTY
from islands.records.reading.formats.text.table_start import COMMENTS, is_text, is_value

#: Rows between a repeated header and the samples below it: units, types.
_MOST_PROPERTIES = 5

#: First cells of rows of statistics.
_STATISTICS = (
    *("mean", "average", "avg", "min", "max", "minimum", "maximum", "std", "stdev", "sd", "sum", "total"),
    *("count", "median", "range", "rms", "variance", "mittelwert", "mittel", "durchschnitt", "summe"),
    *("anzahl", "standardabweichung", "stabw", "moyenne", "somme", "media", "promedio", "gemiddelde"),
)


@dataclass(frozen=True, slots=True)
class SampleRows:
    """Samples of a table, without the other rows.

    Attributes
    ----------
    numbers : array of int
        Line numbers of the samples.
    cells : list of list of str
    starts : tuple of int
        Samples that follow a repeated header.
    notes : tuple of str
        Which rows are left out.
    """

    numbers: "array[int]"
    cells: list[list[str]]
    starts: tuple[int, ...]
    notes: tuple[str, ...]


def keep_samples(
    numbers: "array[int]",
    cells: list[list[str]],
    labels: Sequence[str],
    counted: str,
    missing: Collection[str] = (),
) -> SampleRows:
    """Leave out repeated headers, with the rows around them that are not samples, and a footer.

    Parameters
    ----------
    numbers, cells
        Line numbers and cells of all rows below the header.
    labels : sequence of str
        Cells of the header; empty if the table has none.
    counted : str
        ``line`` or ``row``, for the notes.
    missing : collection of str
        Words of the user for a missing value, in lower case.
    """
    notes = []
    kept = _find_footer(cells, missing)
    if kept < len(cells):
        notes.append(describe_left_out(counted, numbers[kept], numbers[-1], "below the samples"))
        numbers, cells = numbers[:kept], cells[:kept]
    headers = [at for at, row in enumerate(cells) if labels and row and _is_header(row, labels)]
    if not headers:
        return SampleRows(numbers, cells, (), tuple(notes))
    left_out: dict[int, None] = {}
    starts, end = set(), 0
    for header in headers:
        block = _extend(cells, header, end, missing)
        left_out |= dict.fromkeys(block)
        starts.add(block.stop - len(left_out))
        end = block.stop
    times = f"{len(headers)} times, first in" if len(headers) > 1 else "in"
    lines = f"{len(left_out)} {counted}s" if len(left_out) > 1 else "it"
    notes.append(
        f"the header is repeated {times} {counted} {numbers[headers[0]]}: {lines} "
        f"{'are' if len(left_out) > 1 else 'is'} left out"
    )
    rows = [at for at in range(len(cells)) if at not in left_out]
    starts = {start for start in starts if 0 < start < len(rows)}
    return SampleRows(
        array("q", [numbers[at] for at in rows]),
        [cells[at] for at in rows],
        tuple(sorted(starts)),
        tuple(notes),
    )


def describe_left_out(counted: str, first: int, last: int, where: str) -> str:
    """Return which rows are left out: ``lines 202 to 205 below the samples``."""
    if first == last:
        return f"{counted} {first} {where} is not a sample and is left out"
    return f"{counted}s {first} to {last} {where} are not samples and are left out"


def _is_header(row: Sequence[str], labels: Sequence[str]) -> bool:
    if row[0].strip().lstrip(COMMENTS).strip() not in ("", labels[0]):
        return False  # nearly all rows
    cells = [cell.strip() for cell in row]
    cells = cells[1:] if cells[0] and not cells[0].strip(COMMENTS) else cells  # a mark and a blank
    cells[:1] = [cell.lstrip(COMMENTS).strip() for cell in cells[:1]]
    return _trim(cells) == _trim(labels)


def _trim(cells: Sequence[str]) -> Sequence[str]:
    """Return the cells without empty ones at the end."""
    width = len(cells)
    while width and not cells[width - 1]:
        width -= 1
    return list(cells[:width])


def _extend(cells: Sequence[Sequence[str]], header: int, least: int, missing: Collection[str]) -> range:
    """Return the rows around a repeated header, from the least one, that are not samples: units, types."""
    width, first, stop = len(cells[0]), header, header + 1
    while first > least and not _is_sample(cells[first - 1], width, missing):
        first -= 1
    while stop < min(len(cells), header + _MOST_PROPERTIES) and not any(map(is_value, cells[stop])):
        stop += 1
    return range(first, stop)


def _find_footer(cells: Sequence[Sequence[str]], missing: Collection[str]) -> int:
    """Return the number of rows above the footer; all rows if there is none.

    A footer follows a blank row, or its rows are text, or are labelled as statistics. It contains text: a row
    with too few cells, such as the last one of an interrupted record, is none.
    """
    width = len(cells[0]) if cells else 0
    last = len(cells)
    while last and not _is_sample(cells[last - 1], width, missing):
        last -= 1
    below = cells[last:]
    if not last or not any(is_text(cell, missing) for row in below for cell in row):
        return len(cells)
    blank = next((at for at, row in enumerate(below) if _is_blank(row)), len(below))
    if all(_is_footer_row(row, width, missing) for row in below[:blank]):
        return last
    return len(cells)


def _is_blank(row: Sequence[str]) -> bool:
    return not any(cell.strip() for cell in row)


def _is_sample(row: Sequence[str], width: int, missing: Collection[str]) -> bool:
    if not row or len(row) != width or not row[0].strip() or is_text(row[0], missing):
        return False
    return row[0].strip().lower() not in EMPTY and any(map(is_value, row))


def _is_footer_row(row: Sequence[str], width: int, missing: Collection[str]) -> bool:
    if not row or not is_text(row[0], missing):
        return False
    label = row[0].strip().lower().rstrip(":")
    return len(row) != width or label in _STATISTICS or not any(map(is_value, row))
