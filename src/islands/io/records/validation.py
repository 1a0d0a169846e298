"""What makes a record unusable, each with the words that help to mend it."""

from collections import Counter
from collections.abc import Mapping, Sequence
from difflib import get_close_matches

import numpy as np

from islands.errors import RecordError
from islands.io.records.table import Columns

#: Fewer samples tell nothing: the 95 % band of a residual correlation, 1.96 / sqrt(30), is already 0.36, and
#: the quarter kept for validation has seven samples, hardly more than a small model needs to warm up.
MIN_SAMPLES = 30


def check_unique(names: Sequence[str], file: str) -> None:
    """Refuse a file two columns of which share a name.

    Raises
    ------
    RecordError
        A name stands twice.
    """
    twice = [name for name, count in Counter(names).items() if count > 1 and name]
    if twice:
        raise RecordError(f"{file} has several columns called {twice[0]}: rename them in the header")


def check_choice(names: Sequence[str], inputs: Sequence[str], output: str, file: str) -> None:
    """Refuse a choice of columns that the file cannot serve.

    Raises
    ------
    RecordError
        Two columns share a name, no input is given, a column is chosen twice, or a column is not there.
    """
    check_unique(names, file)
    if not inputs:
        raise RecordError(f"no input is given: name one or more of the columns {_listed(names)}")
    if output in inputs:
        raise RecordError(f"column {output} is given as input and as output: choose another one for either")
    repeated = [name for name, count in Counter(inputs).items() if count > 1]
    if repeated:
        raise RecordError(f"column {repeated[0]} is given as an input twice: name it once")
    for name in (*inputs, output):
        if name not in names:
            raise RecordError(f"{file} has no column {name}; it has {_listed(names)}{_guess(name, names)}")


def check_equal_length(lengths: Mapping[str, int], file: str) -> None:
    """Refuse channels of unequal lengths.

    Parameters
    ----------
    lengths : mapping of str to int
        Samples of every channel; the first is the one that the others are held against.

    Raises
    ------
    RecordError
        A channel is shorter or longer than the first.
    """
    (first, samples), *others = lengths.items()
    for name, length in others:
        if length != samples:
            raise RecordError(
                f"{file}: column {first} has {samples} samples, column {name} {length}: channels of one "
                "record are of equal length"
            )


def check_length(columns: Columns) -> None:
    """Refuse a record that is too short to identify anything.

    Raises
    ------
    RecordError
        There are fewer than `MIN_SAMPLES` samples.
    """
    rows = columns.rows
    if not len(rows):
        raise RecordError(f"{rows.file} has not a single sample: take another record")
    if len(rows) < MIN_SAMPLES:
        raise RecordError(
            f"{rows.file}: {len(rows)} samples, from {rows.row(0)} to {rows.row(-1)}, are too few: at least "
            f"{MIN_SAMPLES} are needed; take a longer record or more of its rows"
        )


def check_values(columns: Columns, name: str, missing: bool = False) -> None:
    """Refuse values of a column that are missing or infinite.

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
    if absent[sample:].all():
        raise RecordError(
            f"{rows.place(sample, name)} and all below, to {rows.row(-1)}, are empty or NaN: the channels "
            "are of unequal lengths; complete the column or select the rows that are complete"
        )
    raise RecordError(
        f"{rows.place(sample, name)} is empty or NaN: repair it, for example by interpolation, or select "
        "rows without it"
    )


def check_varies(columns: Columns, name: str) -> None:
    """Refuse a constant column: nothing can be learned from it.

    Raises
    ------
    RecordError
        All values are equal.
    """
    rows, values = columns.rows, columns.numbers[name]
    if values.min() == values.max():
        raise RecordError(
            f"{rows.file}: column {name} is constant, {values[0]:.6g} from {rows.row(0)} to {rows.row(-1)}: "
            "choose a column, or rows, in which something happens"
        )


def _guess(name: str, names: Sequence[str]) -> str:
    spelled = {known.lower(): known for known in names}
    close = get_close_matches(name.lower(), spelled, n=1)
    return f". Did you mean {spelled[close[0]]}?" if close else ""


def _listed(names: Sequence[str]) -> str:
    return ", ".join(name for name in names if name) or "(none with a name)"
