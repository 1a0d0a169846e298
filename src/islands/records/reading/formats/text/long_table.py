"""Long tables: one value in each row, of the signal that another column names.

Databases and automation systems export them. A record has a column for each signal, so that they are
recognised to say what to do.
"""

from collections.abc import Collection, Sequence
from itertools import islice

from islands.records.reading.formats.text.missing_words import is_missing
from islands.records.reading.formats.text.states import is_state

#: Rows that decide, and values of a signal in them, at least.
_DECIDING, _LEAST_VALUES = 1000, 10

#: Names that are listed.
_LISTED = 3

#: Part of the cells that are numbers, at least, in a column of values.
_NUMERIC = 0.5


def describe_long_table(
    names: Sequence[str], cells: Sequence[Sequence[str]], time: str | None, given: Collection[str] = ()
) -> str:
    """State that every row has the value of one signal, and how such a table becomes a record.

    Parameters
    ----------
    names : sequence of str
        The header.
    cells : sequence of sequence of str
        The rows.
    time : str or None
        The time column.
    given : collection of str
        Words of the user for a missing value, in lower case.

    Returns
    -------
    str
        Empty for a table with two columns of numbers, or without a column of names.
    """
    columns = {
        name: [row[place].strip() for row in islice(cells, _DECIDING) if len(row) > place]
        for place, name in enumerate(names)
        if name and name != time
    }
    values, labels = [], {}
    for name, texts in columns.items():
        known = [text for text in texts if not is_missing(text, given)]
        numbers = sum(map(_is_number, known))
        if known and numbers >= _NUMERIC * len(known):
            values.append(name)
        elif known and not numbers and not any(map(is_state, known)):
            labels[name] = list(dict.fromkeys(known))
    if time is None or len(values) != 1 or not labels:
        return ""
    label, signals = max(labels.items(), key=lambda item: len(item[1]))
    if not 1 < len(signals) <= len(columns[label]) / _LEAST_VALUES:
        return ""
    listed = ", ".join(signals[:_LISTED]) + (
        f" and {len(signals) - _LISTED} more" if signals[_LISTED:] else ""
    )
    return (
        f"each row has the value of one signal, which column {label} names ({listed}): a record has a column "
        f"for each signal. Export it in this form, or pivot it: the rows of one {time}, the columns of "
        f"{label}, the values of {values[0]}"
    )


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
