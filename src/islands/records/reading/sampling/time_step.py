"""Sampling time of a record, from a time column that is checked against a uniform grid or as stated."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, check_seconds, join_text, name_option
from islands.records.reading.column_names import (
    TIME_UNITS,
    has_unit_of_time,
    looks_like_time,
    number_column,
    seconds_per_unit,
    time_column,
)
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.sampling.recording import Recording
from islands.records.reading.sampling.time_unit import TimeScale, find_time_unit
from islands.records.reading.sampling.uniform_grid import AGREEMENT, agrees_with_step, uniform_step
from islands.records.reading.table import Columns, RowRange, Table

#: Deviation of rounded stamps from a uniform grid, relative to a step, at most.
_JITTER = 0.1


@dataclass(frozen=True, slots=True)
class TimeSource:
    """Where the sampling of a record is stated.

    Attributes
    ----------
    table : Table
        The file, which may state a sampling time.
    time : str or None
        The time column.
    dt : float or None
        The sampling time given by the user, in seconds. It replaces a time column with jitter or coarse
        stamps.
    structure : str
        The structure of the output. A sampling time stated in it takes precedence over one at the top level.
    options : ReadingOptions
        The name and the unit of the time column, if the user has given them.
    """

    table: Table
    time: str | None
    dt: float | None = None
    structure: str = ""
    options: ReadingOptions = DEFAULT_READING


def find_time_column(table: Table, file: str, taken: Collection[str] = (), structure: str = "") -> str | None:
    """Return the name of the time column of a table, None if it has none.

    Without a column that is named as the time or has time stamps (`time_column`), it is the first column if
    it has a unit of time and increases: oscilloscopes name it after the source of the channels. The first
    column of a file without a header is the time in seconds if it increases uniformly, and not by one as a
    number of samples.

    Parameters
    ----------
    table : Table
    file, taken, structure
        As for `time_column`.

    Raises
    ------
    RecordError
        Several columns may be the time.
    """
    found = time_column(table.names, file, taken, structure, table.clocks)
    if found is not None or not table.names:
        return found
    first = table.names[0]
    is_unnamed = first == number_column(0)
    if first in taken or not (is_unnamed or has_unit_of_time(first)):
        return None
    try:
        stamps = table.read((first,), None).numbers[first]
    except RecordError:
        return None  # it is not numbers
    if stamps.size < 2 or not bool((np.diff(stamps) > 0.0).all()):
        return None
    step = float(stamps[-1] - stamps[0]) / (stamps.size - 1)
    jitter = float(np.abs(stamps - stamps[0] - step * np.arange(stamps.size)).max())
    return first if not is_unnamed or (step != 1.0 and jitter <= _JITTER * step) else None


def find_sampling(source: TimeSource, columns: Columns) -> tuple[float, float | None]:
    """Return the sampling time and the time of the first sample of columns in seconds.

    The latter is None if there is no time column, or if it contains time stamps.

    Raises
    ------
    RecordError
        The time column is not uniform, the sampling time is unknown, or two sources disagree.
    """
    time, dt, file = source.time, source.dt, columns.rows.file
    if len(parts := columns.split(time)) > 1:
        return _find_common_sampling(source, parts)
    known: dict[str, float] = {}
    start = None
    if time is None and source.options.time_unit is not None:
        raise RecordError(
            join_text(
                f"{file} has no time column that ",
                name_option("time_unit"),
                " could describe: name the column by ",
                name_option("time"),
                ", or leave the unit out",
            )
        )
    if dt is not None:
        dt = check_seconds(dt, "the sampling time dt", RecordError)
    if time is not None:
        scale = find_time_scale(source, columns)
        stamps, seconds = scale.stamps, scale.seconds
        if dt is not None and agrees_with_step(stamps, dt / seconds):
            step = _uniform_step_or(dt / seconds, scale, time, columns.rows)
        else:
            step = uniform_step(stamps, time, columns.rows, seconds)
        known[f"column {time}"] = step * seconds
        start = None if scale.elapsed else float(stamps[0]) * seconds
    if dt is not None:
        known[name_option("dt")] = float(dt)
    known |= {f"array {name}": seconds for name, seconds in source.table.stated(source.structure).items()}
    if not known:
        raise RecordError(_unknown_sampling_message(source, file))
    return _reconcile(known, file), start


def _find_common_sampling(source: TimeSource, parts: Sequence[Columns]) -> tuple[float, float | None]:
    """Return the sampling time of all recordings of a file, and the time of the first sample."""
    file = parts[0].rows.file
    parts = [part for part in parts if len(part.rows) > 1]
    if not parts:
        raise RecordError(f"{file}: each sample has its header: delete the repeated headers")
    found = [find_sampling(source, part) for part in parts]
    known = {f"the rows from {part.rows.row(0)}": step for part, (step, _) in zip(parts, found, strict=True)}
    return _reconcile(known, file), found[0][1]


def make_recording(source: TimeSource, columns: Columns, values: NDArray[np.float64]) -> Recording:
    """Return samples with their times, which may be irregular. Without a time column they are uniform.

    Parameters
    ----------
    source : TimeSource
    columns : Columns
        Rows of the file.
    values : ndarray, shape (samples, columns)

    Raises
    ------
    RecordError
        The sampling time is unknown.
    """
    if source.time is None:
        step, _ = find_sampling(source, columns)
        stamps = step * (columns.first + np.arange(len(values), dtype=np.float64))
        return Recording(columns.rows, stamps, values, "time", 1.0)
    scale = find_time_scale(source, columns)
    return Recording(columns.rows, scale.stamps, values, source.time, scale.seconds)


def _uniform_step_or(step: float, scale: TimeScale, time: str, rows: RowRange) -> float:
    """Return the mean step of the time column if it is uniform, else the given step."""
    try:
        return uniform_step(scale.stamps, time, rows, scale.seconds)
    except RecordError:
        return step


def find_time_scale(source: TimeSource, columns: Columns) -> TimeScale:
    """Return the numbers of the time column with their unit.

    Raises
    ------
    RecordError
        The unit is unknown, or a unit is given for time stamps.
    """
    time, options = str(source.time), source.options
    if time in columns.clocks:
        if options.time_unit is not None:
            raise RecordError(
                join_text(
                    f"{columns.rows.file}: column {time} holds time stamps, which have no unit: leave ",
                    name_option("time_unit"),
                    " out",
                )
            )
        return TimeScale(columns.numbers[time], 1.0, elapsed=True)
    field = time.removeprefix(source.structure)
    found = find_time_unit(columns.numbers[time], field, options.time is not None, options.time_unit)
    if found is None:
        raise RecordError(_unknown_sampling_message(source, columns.rows.file))
    return replace(found, note=found.note.replace(field, time, 1))


def _unknown_sampling_message(source: TimeSource, file: str) -> str:
    message = join_text(
        f"{file} has no time column (t, t_s, time_ms ...): give the sampling time by ",
        name_option("dt"),
        ", or name the column by ",
        name_option("time"),
    )
    fields = {name: name.removeprefix(source.structure) for name in source.table.names}
    unknown_unit = [
        name for name, field in fields.items() if looks_like_time(field) and seconds_per_unit(field) is None
    ]
    if unknown_unit:
        units = ", ".join(unit for unit in TIME_UNITS if unit)
        message = join_text(
            message,
            f"; if {unknown_unit[0]} is the time, end its name in one of the units {units}, or give ",
            name_option("time"),
            " and ",
            name_option("time_unit"),
        )
    return message


def _reconcile(known: Mapping[str, float], file: str) -> float:
    """Return the first sampling time after checking that the others agree with it."""
    (source, first), *others = known.items()
    for other, seconds in others:
        if abs(seconds - first) > AGREEMENT * first:
            raise RecordError(
                join_text(
                    *(f"{file}: the sampling time is {first:.6g} s by ", source),
                    *(f" and {seconds:.6g} s by ", other, ": correct one of them"),
                )
            )
    return first
