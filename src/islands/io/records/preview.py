"""Describes a file before anybody chooses columns of it: what is there, and what would be refused."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from islands.errors import RecordError
from islands.io.records.column_names import parse_unit, split_structures, time_column
from islands.io.records.reader import open_record
from islands.io.records.sampling import find_sampling
from islands.io.records.table import Columns, RowRange, Table
from islands.io.records.validation import (
    MIN_SAMPLES,
    check_equal_length,
    check_length,
    check_unique,
    check_values,
    check_varies,
)


@dataclass(frozen=True, slots=True)
class ColumnPreview:
    """A column at a glance.

    Attributes
    ----------
    name, unit : str
        The name, and the unit in it.
    samples : int or None
        Number of samples; None where the column cannot be read.
    minimum, maximum, mean, deviation : float or None
        Of all samples, the deviation being the standard deviation; None where any is missing or infinite.
    problem : str
        Why `read_record` refuses this column, in its words; empty where it does not. That the time is not
        uniform is a warning of the file.
    """

    name: str
    unit: str
    samples: int | None
    minimum: float | None
    maximum: float | None
    mean: float | None
    deviation: float | None
    problem: str


@dataclass(frozen=True, slots=True)
class Preview:
    """A file at a glance.

    Attributes
    ----------
    columns : tuple of ColumnPreview
        In the file's order, without columns that have no name.
    time : str or None
        The column that is taken for the time.
    dt : float or None
        The sampling time in seconds; None where it has to be given, and a warning says why.
    samples : int
        Samples of the channels that make up most of the file.
    warnings : tuple of str
        What `read_record` refuses whatever columns are chosen, and what it infers.
    """

    columns: tuple[ColumnPreview, ...]
    time: str | None
    dt: float | None
    samples: int
    warnings: tuple[str, ...]


def preview(path: str | Path) -> Preview:
    """Describe all columns of a file, each by itself, and say what stands against using it.

    Raises
    ------
    RecordError
        The file is not there or cannot be read at all; never because of a column.
    """
    table, file = open_record(path), Path(path).name
    columns, unread = _read(table)
    groups = _of_equal_length(columns)
    main = groups[0][0] if groups else None
    lonely, unequal = _lengths(groups, columns, file)
    problems = unread | lonely
    time, dt, doubt = _sampling(table, columns, problems, main, file)
    for name, column in columns.items():
        problems.setdefault(name, _problem(column, name, is_time=name == time))
    warnings = (
        _complaint(check_unique, table.names, file),
        *unequal,
        _complaint(check_length, columns[main]) if main else "",
        doubt,
        *table.remarks(tuple(columns)),
    )
    return Preview(
        columns=tuple(
            _described(name, parse_unit(name.removeprefix(structure)), columns.get(name), problems[name])
            for name, structure in split_structures(table.names).items()
            if name
        ),
        time=time,
        dt=dt,
        samples=len(columns[main].rows) if main else 0,
        warnings=tuple(filter(None, warnings)),
    )


def _complaint(check: Callable[..., object], *arguments: Any) -> str:
    """Return what a check refuses, in its words; empty where it does not."""
    try:
        check(*arguments)
    except RecordError as error:
        return str(error)
    return ""


def _read(table: Table) -> tuple[dict[str, Columns], dict[str, str]]:
    """Read every column that has a name, by itself; return those that can be read, and why others cannot."""
    columns, unread = {}, {}
    for name in filter(None, dict.fromkeys(table.names)):
        try:
            columns[name] = table.read((name,), None)
        except RecordError as error:
            unread[name] = str(error)
    return columns, unread


def _of_equal_length(columns: Mapping[str, Columns]) -> list[list[str]]:
    """Group the columns by their lengths, the group with most numbers first: it is what the file is about."""
    groups: dict[int, list[str]] = {}
    for name, column in columns.items():
        groups.setdefault(len(column.rows), []).append(name)
    return [groups[length] for length in sorted(groups, key=lambda length: -length * len(groups[length]))]


def _lengths(
    groups: Sequence[Sequence[str]], columns: Mapping[str, Columns], file: str
) -> tuple[dict[str, str], list[str]]:
    """Return the problems of columns without a companion of their length, and warnings of other recordings.

    Columns of another length than the most are no problem by themselves: two of them make a record.
    """
    problems: dict[str, str] = {}
    warnings = []
    for group in groups[1:]:
        length = len(columns[group[0]].rows)
        first = {groups[0][0]: len(columns[groups[0][0]].rows)}
        complaints = {name: _complaint(check_equal_length, first | {name: length}, file) for name in group}
        if len(group) > 1 and length >= MIN_SAMPLES:
            warnings.append(complaints[group[0]])
        else:
            problems |= complaints
    return problems, warnings


def _sampling(
    table: Table,
    columns: Mapping[str, Columns],
    problems: Mapping[str, str],
    main: str | None,
    file: str,
) -> tuple[str | None, float | None, str]:
    """Return the time column, the sampling time in seconds, and why there is none."""
    time = None
    structure = split_structures(table.names)[main] if main else ""
    try:
        time = time_column(table.names, file, structure=structure)
        asked = time or main
        if asked is not None and asked in problems:
            return time, None, problems[asked]
        known = columns[asked] if asked else Columns(RowRange(file, "sample", ()), {}, 0)
        if time is not None:
            check_values(known, time)
            if len(known.rows) < 2:  # no step: `check_length` has more to say
                return time, None, ""
        return time, find_sampling(table, known, time, None, structure)[0], ""
    except RecordError as error:
        return time, None, str(error)


def _problem(column: Columns, name: str, is_time: bool) -> str:
    """Return what `read_record` says of a column's values; the time is held against a grid by `_sampling`."""
    if not len(column.rows):
        return _complaint(check_length, column)
    return _complaint(check_values, column, name) or (
        "" if is_time else _complaint(check_varies, column, name)
    )


def _described(name: str, unit: str, column: Columns | None, problem: str) -> ColumnPreview:
    values = np.empty(0) if column is None else column.numbers[name]
    samples = None if column is None else len(values)
    if not len(values):
        return ColumnPreview(name, unit, samples, None, None, None, None, problem)
    with np.errstate(over="ignore", invalid="ignore"):
        numbers = float(values.min()), float(values.max()), float(values.mean()), float(values.std())
    if not np.isfinite(numbers).all():
        return ColumnPreview(name, unit, samples, None, None, None, None, problem)
    return ColumnPreview(name, unit, samples, *numbers, problem)
