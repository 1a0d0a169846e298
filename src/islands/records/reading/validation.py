"""Checks of records. Every error message says how to correct the record."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, join_text, name_option, suggest
from islands.records.reading.table import Columns

#: Smallest number of samples. With 30 samples the 95 % band of a residual correlation, 1.96 / sqrt(30), is
#: already 0.36, and the quarter kept for validation has seven samples, hardly more than the warm-up of a
#: small model.
MIN_SAMPLES = 30

#: Names that a message lists, at most.
_LISTED = 50


def check_unique(names: Sequence[str], file: str) -> None:
    """Refuse a file in which two columns have the same name.

    Raises
    ------
    RecordError
        A name occurs twice.
    """
    repeated = [name for name, count in Counter(names).items() if count > 1 and name]
    if repeated:
        raise RecordError(f"{file} has several columns named {repeated[0]}: rename them in the header")


def check_choice(
    names: Sequence[str],
    inputs: Sequence[str],
    output: str | None,
    file: str,
    time: str | None = None,
    others: str = "",
) -> None:
    """Refuse an invalid choice of columns.

    Raises
    ------
    RecordError
        Two columns have the same name, no input is given, a column is chosen twice, or a column does not
        exist.
    """
    check_unique(names, file)
    if not inputs:
        raise RecordError(f"no input is given: name one or more of the columns {_list_names(names)}")
    if output in inputs:
        raise RecordError(f"column {output} is given as input and as output: choose different columns")
    repeated = [name for name, count in Counter(inputs).items() if count > 1]
    if repeated:
        raise RecordError(f"column {repeated[0]} is given as an input twice: name it once")
    chosen = (*inputs, *([] if output is None else [output]))
    if time in chosen:
        raise RecordError(f"column {time} is given as the time and as an input or output: name another one")
    for name in (*chosen, *([] if time is None else [time])):
        if name not in names:
            raise RecordError(
                f"{file} has no column {name}; it has {_list_names(names)}{'; ' if others else ''}{others}"
                f"{suggest(name, names)}"
            )


def check_equal_length(lengths: Mapping[str, int], file: str) -> None:
    """Refuse channels of unequal lengths.

    Parameters
    ----------
    lengths : mapping of str to int
        Number of samples of every channel. The others are compared with the first one.

    Raises
    ------
    RecordError
        A channel is shorter or longer than the first one.
    """
    (first, samples), *others = lengths.items()
    for name, length in others:
        if length != samples:
            raise RecordError(
                f"{file}: column {first} has {samples} samples, column {name} {length}: the channels of a "
                "record must have equal length"
            )


def check_length(columns: Columns, least: int = MIN_SAMPLES) -> None:
    """Refuse a record that is too short, by default for identification.

    Raises
    ------
    RecordError
        There are fewer than ``least`` samples.
    """
    rows = columns.rows
    if not len(rows):
        raise RecordError(f"{rows.file} has no samples: use another record")
    if len(rows) < least:
        raise RecordError(
            f"{rows.file}: {len(rows)} samples, from {rows.row(0)} to {rows.row(-1)}, are too few: at least "
            f"{least} are needed; use a longer record or more of its rows"
        )


def check_values(columns: Columns, name: str, missing: bool = False) -> None:
    """Refuse missing or infinite values in a column.

    Parameters
    ----------
    columns : Columns
        The converted columns.
    name : str
        The column to check.
    missing : bool
        Accept missing values.

    Raises
    ------
    RecordError
        A value is missing or infinite.
    """
    rows, values = columns.rows, columns.numbers[name]
    infinite = np.isinf(values)
    if infinite.any():
        sample = int(np.argmax(infinite))
        raise RecordError(f"{rows.place(sample, name)} is infinite: repair it or leave the row out")
    absent = np.isnan(values)
    if missing or not absent.any():
        return
    sample = int(np.argmax(absent))
    if absent.all():
        raise RecordError(f"{rows.file}: column {name} has no values: choose another column")
    if absent[sample:].all():
        raise RecordError(
            f"{rows.place(sample, name)} and all below, to {rows.row(-1)}, are empty or NaN: the channels "
            "have unequal lengths; complete the column or select the rows that are complete"
        )
    raise RecordError(
        join_text(
            f"{rows.place(sample, name)}{and_others(int(absent.sum()))} empty or NaN: give ",
            name_option("gaps", "interpolate"),
            " to fill it or ",
            name_option("gaps", "split"),
            " to leave the row out, or select rows without it; only an output, of several the first, may "
            "have empty cells",
        )
    )


def and_others(cells: int) -> str:
    """Return the end of the subject of a sentence about several cells, of which the first is named."""
    return f" and {cells - 1} more of its cells are" if cells > 1 else " is"


def check_repaired(values: NDArray[np.float64], name: str, file: str, missing: bool) -> None:
    """Refuse a column without any value, and an infinite value.

    Raises
    ------
    RecordError
        A value is infinite, or is missing although missing values were to be repaired.
    """
    if len(values) < MIN_SAMPLES:
        raise RecordError(
            join_text(
                f"{file}: {len(values)} samples remain, and at least {MIN_SAMPLES} are needed: use a longer "
                "record, a shorter ",
                name_option("resample", example="DT"),
                ", or ",
                name_option("gaps", "interpolate"),
            )
        )
    if np.isinf(values).any():
        raise RecordError(f"{file}: column {name} has an infinite value: repair it or leave the row out")
    if not missing and np.isnan(values).any():
        raise RecordError(f"{file}: column {name} has no values: choose another column")


def check_varies(columns: Columns, name: str) -> None:
    """Refuse a constant or empty column: it contains no information for identification.

    Raises
    ------
    RecordError
        All values are equal, or missing.
    """
    rows, values = columns.rows, columns.numbers[name]
    values = values[~np.isnan(values)]
    if not values.size:
        raise RecordError(
            f"{rows.file}: column {name} has no value from {rows.row(0)} to {rows.row(-1)}: choose another "
            "column or other rows"
        )
    if values.min() == values.max():
        raise RecordError(
            f"{rows.file}: column {name} is constant, {values[0]:.6g} from {rows.row(0)} to {rows.row(-1)}: "
            "choose a column, or rows, that vary"
        )


def _list_names(names: Sequence[str]) -> str:
    named = [name for name in names if name]
    more = f" and {len(named) - _LISTED} more" if len(named) > _LISTED else ""
    return ", ".join(named[:_LISTED]) + more or "(none with a name)"
