"""Notes on a record: a problem or a remark, its rows, and the options that its text advises."""

import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

#: Rows that a note lists, at most.
MOST_ROWS = 20

_NUMBER = r"[-+]?\d[\d.]*(?:e[-+]?\d+)?"
_WORD = r"""'[^']*'|"[^"]*"|[^\s,;:()]+"""

#: Options that a text may advise, with the pattern of their values. Those without one need a value that only
#: the user knows.
_OPTIONS = {
    "gaps": '"?(?:split|interpolate)"?',
    "outliers": '"?(?:exclude|keep)"?',
    "rates": '"?(?:mean|sample|rows)"?',
    "decimal": '"?(?:point|comma)"?',
    "dates": '"?(?:day-first|month-first)"?',
    "resample": _NUMBER,
    "dt": _NUMBER,
    "missing": _WORD,
    "time_unit": '"?(?:s|ms|us|ns|min|h|d)"?(?![\\w-])',
    "time": "",
    "timezone": "",
    "sheet": "",
}

#: An option as `islands.errors.name_option` writes it for the library or for the command line.
_ADVICE = {
    name: re.compile(rf"(?<![\w-])(?:{name}=|--{name.replace('_', '-')}(?![\w-]) ?)({pattern})?")
    for name, pattern in _OPTIONS.items()
}


@dataclass(frozen=True, slots=True)
class AdvisedOption:
    """Option of reading, or sampling time ``dt``, that a note advises.

    Attributes
    ----------
    option : str
        Field of `islands.io.records.reading_options.ReadingOptions`, or ``dt``.
    value : str, float or None
        Its value; None if the user has to know it.
    """

    option: str
    value: str | float | None


@dataclass(frozen=True, slots=True)
class RecordNote:
    """Note on a record.

    Attributes
    ----------
    text : str
    is_problem : bool
        Whether the record cannot be used as it is; otherwise the note states what was inferred or left out.
    rows : tuple of int
        Rows of the file that it concerns, from 0 without the header: the first `MOST_ROWS`.
    advice : tuple of AdvisedOption
        Options that the text names, in its order.
    """

    text: str
    is_problem: bool
    rows: tuple[int, ...]
    advice: tuple[AdvisedOption, ...]

    def as_document(self) -> dict[str, Any]:
        """Return the note as a JSON document."""
        return asdict(self)


def make_note(text: str, is_problem: bool = False, rows: Iterable[int] = ()) -> RecordNote:
    """Return a note with the options that its text advises."""
    return RecordNote(text, is_problem, tuple(map(int, rows))[:MOST_ROWS], find_advice(text))


def find_advice(text: str) -> tuple[AdvisedOption, ...]:
    """Return the options that a text names by `islands.errors.name_option`, in its order.

    The text of a message is the one source of its advice: every caller reads the same options from it.
    """
    found = sorted(
        (match.start(), name, match[1]) for name, form in _ADVICE.items() for match in form.finditer(text)
    )
    return tuple(dict.fromkeys(AdvisedOption(name, _read_value(name, value)) for _, name, value in found))


def _read_value(name: str, written: str | None) -> str | float | None:
    """Return a value; None without one, and for a placeholder, which is written in capital letters."""
    if not written:
        return None
    if _OPTIONS[name] == _NUMBER:
        return float(written.rstrip("."))
    return written.rstrip(".").strip("\"'") or None
