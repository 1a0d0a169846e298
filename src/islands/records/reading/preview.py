"""Preview of a file before columns are chosen: its columns, their statistics and their problems."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from islands.errors import RecordError
from islands.records.channel_names import parse_unit
from islands.records.reading.column_names import find_column, split_structures
from islands.records.reading.options import DEFAULT_READING, ROWS, ReadingOptions
from islands.records.reading.reader import open_record
from islands.records.reading.sampling.column_clocks import ColumnClock, find_clocks, may_differ
from islands.records.reading.sampling.common_clock import common_step, describe_clocks
from islands.records.reading.sampling.time_step import (
    TimeSource,
    find_sampling,
    find_time_column,
    find_time_scale,
)
from islands.records.reading.table import Columns, RowRange, Table
from islands.records.reading.validation import (
    MIN_SAMPLES,
    check_equal_length,
    check_length,
    check_unique,
    check_values,
    check_varies,
)


@dataclass(frozen=True, slots=True)
class ColumnPreview:
    """Preview of a column.

    Attributes
    ----------
    name, unit : str
        The column's name, and the unit in the name.
    samples : int or None
        Number of samples; None if the column cannot be read.
    minimum, maximum, mean, deviation : float or None
        Statistics over the samples with a value; ``deviation`` is the standard deviation. None if no sample
        has one, or if a sample is infinite.
    missing : int
        Number of samples without a value. Those of an output are skipped; `read_record` refuses those of an
        input without ``gaps``.
    dt : float or None
        Sampling time of the column in seconds; None if it is unknown.
    problem : str
        The message with which `read_record` refuses this column as an output, and as an input without
        missing values; empty if it accepts the column. A non-uniform time column is reported as a warning of
        the file.
    """

    name: str
    unit: str
    samples: int | None
    minimum: float | None
    maximum: float | None
    mean: float | None
    deviation: float | None
    missing: int
    dt: float | None
    problem: str


@dataclass(frozen=True, slots=True)
class Preview:
    """Preview of a file.

    Attributes
    ----------
    columns : tuple of ColumnPreview
        Columns in the file's order, without unnamed columns.
    time : str or None
        Name of the time column.
    dt : float or None
        Sampling time in seconds; None if the user must give it. A warning then states the reason.
    samples : int
        Number of samples of the largest group of columns of equal length.
    warnings : tuple of str
        Problems that make `read_record` fail for any choice of columns, and remarks on inferred properties.
    problems : tuple of str
        The warnings that are problems.
    """

    columns: tuple[ColumnPreview, ...]
    time: str | None
    dt: float | None
    samples: int
    warnings: tuple[str, ...]
    problems: tuple[str, ...] = ()


def preview(path: str | Path, options: ReadingOptions = DEFAULT_READING) -> Preview:
    """Describe every column of a file separately, and list the problems of the file.

    Raises
    ------
    RecordError
        The file does not exist or cannot be read. Problems of single columns do not raise.
    """
    return preview_table(open_record(path, options), Path(path).name, options)


def preview_table(table: Table, file: str, options: ReadingOptions = DEFAULT_READING) -> Preview:
    """Describe every column of an open table like `preview`; ``file`` is its name in messages."""
    columns, unread = _read_columns(table)
    groups = _group_by_length(columns)
    main = groups[0][0] if groups else None
    unmatched, unequal = _check_lengths(groups, columns, file)
    problems = unread | unmatched
    time, dt, sampling_problem = _preview_sampling(table, columns, problems, main, file, options)
    names, clocks, seconds = _find_clocks(table, columns, groups, time, dt, options)
    # Of all columns but those with cells between the samples, the clock is that of the rows.
    own = {name: each for name, each in zip(names, clocks, strict=True) if each.kind == "cells"}
    if own and dt is None and seconds is not None and (common := common_step(clocks)) is not None:
        # The rows are those of several clocks, and irregular for this reason.
        dt, sampling_problem = float(f"{common * seconds:.12g}"), ""
    if time is not None and time in table.clocks:
        # The column of the dates is read with that of the time of day.
        problems[table.clocks[time]] = ""
    for name, column in columns.items():
        problems.setdefault(name, _find_problem(column, name, name == time))
    duplicate = _error_message(check_unique, table.names, file)
    too_short = _error_message(check_length, columns[main]) if main else ""
    warnings = (
        *(duplicate, *unequal, too_short, sampling_problem),
        describe_clocks(names, clocks, seconds) if own else "",
        _describe_time_unit(table, columns, time, options),
        *table.remarks(tuple(columns)),
        *dict.fromkeys(note for column in columns.values() for note in column.notes),
    )
    return Preview(
        columns=tuple(
            _preview_column(
                *(name, _find_unit(name, structure, columns.get(name)), columns.get(name), problems[name]),
                _find_step(own[name], seconds) if name in own else dt,
                name in own,
            )
            for name, structure in split_structures(table.names).items()
            if name
        ),
        time=time,
        dt=dt,
        samples=len(columns[main].rows) if main else 0,
        warnings=tuple(filter(None, warnings)),
        problems=tuple(filter(None, (duplicate, too_short, sampling_problem))),
    )


def _error_message(check: Callable[..., object], *arguments: Any) -> str:
    """Return the message of the error that a check raises; empty if the check passes."""
    try:
        check(*arguments)
    except RecordError as error:
        return error.message
    return ""


def _read_columns(table: Table) -> tuple[dict[str, Columns], dict[str, str]]:
    """Read every named column separately; return the readable ones and the errors of the others."""
    columns, unread = {}, {}
    for name in filter(None, dict.fromkeys(table.names)):
        try:
            columns[name] = table.read((name,), None)
        except RecordError as error:
            unread[name] = error.message
    return columns, unread


def _group_by_length(columns: Mapping[str, Columns]) -> list[list[str]]:
    """Group the columns by length. The group with the most numbers comes first: it is the main recording."""
    groups: dict[int, list[str]] = {}
    for name, column in columns.items():
        groups.setdefault(len(column.rows), []).append(name)
    return [groups[length] for length in sorted(groups, key=lambda length: -length * len(groups[length]))]


def _check_lengths(
    groups: Sequence[Sequence[str]], columns: Mapping[str, Columns], file: str
) -> tuple[dict[str, str], list[str]]:
    """Return the problems of columns with a unique length, and warnings for further recordings.

    A group of two or more columns with a length different from the main group is not a problem: it can form a
    record.
    """
    problems: dict[str, str] = {}
    warnings = []
    for group in groups[1:]:
        length = len(columns[group[0]].rows)
        first = {groups[0][0]: len(columns[groups[0][0]].rows)}
        messages = {name: _error_message(check_equal_length, first | {name: length}, file) for name in group}
        if len(group) > 1 and length >= MIN_SAMPLES:
            warnings.append(messages[group[0]])
        else:
            problems |= messages
    return problems, warnings


def _preview_sampling(
    table: Table,
    columns: Mapping[str, Columns],
    problems: Mapping[str, str],
    main: str | None,
    file: str,
    options: ReadingOptions,
) -> tuple[str | None, float | None, str]:
    """Return the time column, the sampling time in seconds, and the reason if the latter is unknown."""
    time = None
    structure = split_structures(table.names)[main] if main else ""
    try:
        named = None if options.time is None else find_column(options.time, table.names)
        time = named or find_time_column(table, file, structure=structure)
        source = time or main
        if source is not None and source in problems:
            return time, None, problems[source]
        known = columns[source] if source else Columns(RowRange(file, "sample", ()), {}, 0)
        if time is not None:
            check_values(known, time)
            if len(known.rows) < 2:  # no step; the message of `check_length` is more helpful
                return time, None, ""
        return time, find_sampling(TimeSource(table, time, None, structure, options), known)[0], ""
    except RecordError as error:
        return time, None, error.message


def _describe_time_unit(
    table: Table, columns: Mapping[str, Columns], time: str | None, options: ReadingOptions
) -> str:
    """Return the unit of the time column if it was assumed; empty otherwise."""
    if time is None or time not in columns:
        return ""
    try:
        source = TimeSource(table, time, None, split_structures(table.names)[time], options)
        return find_time_scale(source, columns[time]).note
    except RecordError:
        return ""  # `_preview_sampling` states it


def _find_clocks(
    table: Table,
    columns: Mapping[str, Columns],
    groups: Sequence[Sequence[str]],
    time: str | None,
    dt: float | None,
    options: ReadingOptions,
) -> tuple[Sequence[str], Sequence[ColumnClock], float | None]:
    """Return the columns of the main recording, their clocks, and the unit of their stamps in seconds.

    The unit is None if the stamps are numbers of rows. There are no columns if all have the clock of rows.
    Which values are held depends on the columns that are chosen.
    """
    names = [name for name in (groups[0] if groups else ()) if name != time and name not in table.clocks]
    none = (), (), None
    if not names or options.rates == ROWS or (time is not None and time not in groups[0]):
        return none
    values = np.column_stack([columns[name].numbers[name] for name in names])
    if not may_differ(values, ()):
        return none
    stamps, seconds = np.arange(len(values), dtype=np.float64), dt
    if time is not None:
        try:
            source = TimeSource(table, time, None, split_structures(table.names)[time], options)
            scale = find_time_scale(source, columns[time])
        except RecordError:
            return none
        stamps, seconds = scale.stamps, scale.seconds
    clocks = find_clocks(stamps, values, ())
    return (names, clocks, seconds) if clocks else none


def _find_problem(column: Columns, name: str, is_time: bool) -> str:
    """Return the message of `read_record` about a column's values.

    `_preview_sampling` checks whether the time column is uniform. Any other column may be an output, or have
    a clock of fewer samples than the rows, so that some of its cells may be empty.
    """
    if not len(column.rows):
        return _error_message(check_length, column)
    may_miss = not is_time and not np.isnan(column.numbers[name]).all()
    return _error_message(check_values, column, name, may_miss) or (
        "" if is_time else _error_message(check_varies, column, name)
    )


def _find_unit(name: str, structure: str, column: Columns | None) -> str:
    return parse_unit(name.removeprefix(structure)) or ("" if column is None else column.units.get(name, ""))


def _find_step(clock: ColumnClock, seconds: float | None) -> float | None:
    return None if seconds is None else float(f"{clock.step * seconds:.12g}")


def _preview_column(
    name: str, unit: str, column: Columns | None, problem: str, dt: float | None, has_clock: bool
) -> ColumnPreview:
    values = np.empty(0) if column is None else column.numbers[name]
    known = values[~np.isnan(values)]
    # The cells between the samples of a column with its own clock are no missing values.
    missing = 0 if has_clock else len(values) - len(known)
    samples = None if column is None else len(known) if has_clock else len(values)
    if not len(known):
        return ColumnPreview(name, unit, samples, None, None, None, None, missing, dt, problem)
    with np.errstate(over="ignore", invalid="ignore"):
        numbers = float(known.min()), float(known.max()), float(known.mean()), float(known.std())
    if not np.isfinite(numbers).all():
        return ColumnPreview(name, unit, samples, None, None, None, None, missing, dt, problem)
    return ColumnPreview(name, unit, samples, *numbers, missing, dt, problem)
