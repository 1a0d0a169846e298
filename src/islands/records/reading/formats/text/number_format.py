"""Decimal mark and thousands separators of a text table, inferred from all numbers that are read."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from islands.errors import RecordError, join_text, name_option
from islands.records.reading.table import RowRange

#: Characters that only separate thousands: blanks, also those that do not break a line, and apostrophes.
_SPACES = " \N{NO-BREAK SPACE}\N{THIN SPACE}\N{NARROW NO-BREAK SPACE}'\N{RIGHT SINGLE QUOTATION MARK}"

# A run of digits must match in one way only: otherwise the time grows with the square of its length.
_EXPONENT = r"(?:[eE][+-]?\d+)?"
_PLAIN = re.compile(rf"\s*[+-]?(?:\d+(?:([.,])\d*)?|([.,])\d+){_EXPONENT}\s*")

#: Thousands: the first group does not begin with zero, all others have three digits.
_GROUPED = re.compile(
    rf"\s*[+-]?[1-9]\d{{0,2}}(?:([.,{_SPACES}])\d{{3}})(?:\1\d{{3}})*(?:([.,])\d*)?{_EXPONENT}\s*"
)

#: A number with two readings, such as 1,234.
_AMBIGUOUS = re.compile(r"\s*[+-]?[1-9]\d{0,2}([.,])\d{3}\s*")

_OTHER = {",": ".", ".": ","}

#: Characters of a cell in a message.
_SHOWN = 40

#: Place of a cell: column, sample and text.
_Cell = tuple[str, int, str]


@dataclass(frozen=True, slots=True)
class NumberFormat:
    """How numbers are written.

    Attributes
    ----------
    decimal : str
        The decimal mark.
    separators : str
        Characters between thousands; empty if there are none.
    note : str
        What was inferred, for a preview; empty for numbers with points only.
    """

    decimal: str = "."
    separators: str = ""
    note: str = ""

    def normalise(self, text: str) -> str:
        """Return a number with a decimal point and without separators of thousands."""
        if self.separators and (match := _GROUPED.fullmatch(text)) and match[1] in self.separators:
            text = text.strip().replace(match[1], "")
        return text.replace(self.decimal, ".")


def is_number(text: str) -> bool:
    """Return whether a cell is a finite number, with decimal point or comma, also with separate thousands."""
    return bool(_PLAIN.fullmatch(text)) or _match_groups(text) is not None


def _match_groups(text: str) -> re.Match[str] | None:
    match = _GROUPED.fullmatch(text)
    return match if match and match[1] != match[2] else None


def find_number_format(
    texts: Mapping[str, Sequence[str]], rows: RowRange, decimal: str | None = None, separator: str = ""
) -> NumberFormat:
    """Infer how numbers are written. All columns use the same format.

    A number such as ``1,234`` has two readings. It is read like the numbers that have one reading.

    Parameters
    ----------
    texts : mapping of str to sequence of str
        The cells of every column.
    rows : RowRange
        Position of the cells in the file.
    decimal : str or None
        The decimal mark, if the user has given it.
    separator : str
        Separator of the cells. A semicolon is used where the comma is the decimal mark.

    Raises
    ------
    RecordError
        Marks are mixed, or all numbers with a comma have two readings.
    """
    proofs, ambiguous, grouped = _find_marks(texts)
    mark = decimal or _choose_mark(proofs, ambiguous, rows, separator)
    other = _OTHER[mark]
    if other in proofs or (other in ambiguous and other not in grouped and decimal is None):
        seen = {**ambiguous, **proofs}
        _raise_mixed(seen.get(mark), seen[other], mark, rows)
    separators = [*(sign for sign in grouped if sign != mark), *(other if other in ambiguous else "")]
    comma = proofs.get(",") or ambiguous.get(",") if mark == "," else None
    note = f"the comma in {_place(comma, rows)} is read as a decimal mark" if comma else ""
    if separators:
        cell = grouped[separators[0]] if grouped else ambiguous[other]
        note += f"{'; ' if note else ''}{_place(cell, rows)} is read with thousands separated"
    return NumberFormat(mark, "".join(dict.fromkeys(separators)), note)


def _find_marks(
    texts: Mapping[str, Sequence[str]],
) -> tuple[dict[str, _Cell], dict[str, _Cell], dict[str, _Cell]]:
    """Return the first cell of each decimal mark, of each mark with two readings, and of each separator."""
    proofs: dict[str, _Cell] = {}
    ambiguous: dict[str, _Cell] = {}
    grouped: dict[str, _Cell] = {}
    for name, column in texts.items():
        for sample, text in enumerate(column):
            cell = (name, sample, text)
            if match := _AMBIGUOUS.fullmatch(text):
                ambiguous.setdefault(match[1], cell)
            elif match := _PLAIN.fullmatch(text):
                if mark := match[1] or match[2]:
                    proofs.setdefault(mark, cell)
            elif match := _match_groups(text):
                grouped.setdefault(match[1], cell)
                if mark := _OTHER.get(match[1]) or match[2]:
                    proofs.setdefault(mark, cell)
    return proofs, ambiguous, grouped


def _choose_mark(
    proofs: Mapping[str, _Cell], ambiguous: Mapping[str, _Cell], rows: RowRange, separator: str
) -> str:
    if proofs:
        return next(iter(proofs))
    if "," not in ambiguous:
        return "."
    if "." in ambiguous or separator != ";":
        _, _, text = ambiguous[","]
        digits = text.strip().replace(",", "")
        raise RecordError(
            join_text(
                f"{_place(ambiguous[','], rows)} may be {digits} or {text.strip().replace(',', '.')}, and no "
                "other number tells: ",
                _make_remedy(),
            )
        )
    return ","


def _raise_mixed(cell: _Cell | None, other: _Cell, mark: str, rows: RowRange) -> None:
    if cell is None:
        raise RecordError(
            join_text(
                f"{_place(other, rows)} is not a number with the decimal mark '{mark}': ", _make_remedy()
            )
        )
    comma, point = (cell, other) if mark == "," else (other, cell)
    raise RecordError(
        join_text(
            f"a decimal comma in {_place(comma, rows)}, a decimal point in {_place(point, rows)}: write all "
            "numbers with the same mark, or, if one of the two separates thousands, ",
            _make_remedy(),
        )
    )


def _make_remedy() -> str:
    return join_text("give ", name_option("decimal", "point"), " or ", name_option("decimal", "comma"))


def _place(cell: _Cell, rows: RowRange) -> str:
    name, sample, text = cell
    shown = text.strip()
    return f"{rows.place(sample, name)} ({shown if len(shown) <= _SHOWN else f'{shown[:_SHOWN]}...'})"
