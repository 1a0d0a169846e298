"""Milliseconds that a logger writes into a column next to the time stamps, which have whole seconds."""

import re
from collections.abc import Collection, Mapping, Sequence

from islands.records.channel_names import spell_unit
from islands.records.reading.formats.text.missing_words import is_missing

#: Samples that decide.
_DECIDING = 20

_MILLISECONDS = re.compile(r"\s*(\d{1,3})\s*")

#: Seconds of a time stamp without decimals.
_WHOLE_SECONDS = re.compile(r"(?<=\d:\d\d:\d\d)(?![\d.,:])")


def find_milliseconds(
    names: Sequence[str],
    cells: Sequence[Sequence[str]],
    clocks: Mapping[str, str],
    missing: Collection[str] = (),
) -> str:
    """Return the column that contains the milliseconds of the time stamps; empty if there is none.

    It is named as the unit (``ms``, ``Millisecond``) and contains integers from 0 to 999, the stamps of the
    only clock have whole seconds, and all rows have a cell of each column.

    Parameters
    ----------
    names : sequence of str
        The header.
    cells : sequence of sequence of str
        One sequence per sample.
    clocks : mapping of str to str
        Columns of time stamps.
    missing : collection of str
        Words of the user for a missing value, in lower case.
    """
    found = [place for place, name in enumerate(names) if spell_unit(name.strip().lower()) == "ms"]
    if len(found) != 1 or len(clocks) != 1 or names[found[0]] in clocks:
        return ""
    stamp = names.index(next(iter(clocks)))
    if any(len(row) != len(names) for row in cells):
        return ""
    pairs = [(row[stamp], row[found[0]]) for row in cells[:_DECIDING]]
    filled = [pair for pair in pairs if not any(is_missing(cell, missing) for cell in pair)]
    fits = all(_WHOLE_SECONDS.search(time) and _MILLISECONDS.fullmatch(part) for time, part in filled)
    return names[found[0]] if filled and fits else ""


def append_milliseconds(stamp: str, milliseconds: str) -> str:
    """Return a time stamp with its milliseconds as decimals; unchanged if there are none."""
    found = _MILLISECONDS.fullmatch(milliseconds)
    return _WHOLE_SECONDS.sub(f".{found[1]:0>3}", stamp, count=1) if found else stamp
