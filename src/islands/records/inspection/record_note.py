"""Notes on a record: a problem or a remark, its rows, and the options that its text advises."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, cast

from islands.errors import get_options

#: Rows that a note lists, at most.
MOST_ROWS = 20

#: Options that a note advises. Others, such as names of columns, change more than the reading of values.
OPTIONS = frozenset(
    (
        *("gaps", "outliers", "rates", "decimal", "dates", "resample", "dt", "missing"),
        *("time", "time_unit", "timezone", "sheet"),
    )
)


@dataclass(frozen=True, slots=True)
class AdvisedOption:
    """Option of reading, or sampling time ``dt``, that a note advises.

    Attributes
    ----------
    option : str
        Field of `islands.records.reading.options.ReadingOptions`, or ``dt``.
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
    """Return a note with the options of `OPTIONS` that its text names; see `islands.errors.AdvisedText`."""
    advice = tuple(
        AdvisedOption(name, cast("str | float | None", value))
        for name, value in get_options(text)
        if name in OPTIONS
    )
    return RecordNote(str(text), is_problem, tuple(map(int, rows))[:MOST_ROWS], advice)
