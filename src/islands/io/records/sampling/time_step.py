"""Sampling time of a record, from a time column that is checked against a uniform grid or as stated."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from islands.data.channel_names import parse_unit
from islands.errors import RecordError
from islands.io.records.column_names import TIME_UNITS, looks_like_time, seconds_per_unit
from islands.io.records.sampling.recording import Recording
from islands.io.records.sampling.uniform_grid import AGREEMENT, agrees_with_step, uniform_step
from islands.io.records.table import Columns, Table

#: Smallest numbers of time stamps without a unit that cannot be seconds since 1970, and the units of such
#: numbers in seconds: 1e11 s are 3000 years.
_EPOCHS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))


def find_sampling(
    table: Table,
    columns: Columns,
    time: str | None,
    dt: float | None,
    structure: str = "",
    given: bool = False,
) -> tuple[float, float | None]:
    """Return the sampling time and the time of the first sample in seconds.

    The latter is None if there is no time column, or if it contains time stamps.

    Parameters
    ----------
    table, columns
        The file and the columns read from it.
    time : str or None
        The time column.
    dt : float or None
        The sampling time given by the user, in seconds. It replaces a time column with jitter or coarse
        stamps.
    structure : str
        The structure of the output. A sampling time stated in it takes precedence over one at the top level.
    given : bool
        Whether the user has named the time column.

    Raises
    ------
    RecordError
        The time column is not uniform, the sampling time is unknown, or two sources disagree.
    """
    if len(parts := columns.split(time)) > 1:
        return _find_common_sampling(table, parts, time, dt, structure, given)
    file = columns.rows.file
    known: dict[str, float] = {}
    start = None
    if dt is not None and not (np.isfinite(dt) and dt > 0):
        raise RecordError(
            f"the sampling time --dt (library: dt=) must be a positive number of seconds, got {dt}"
        )
    if time is not None:
        stamps = columns.numbers[time]
        seconds = time_scale(table, columns, time, structure, given)
        if dt is not None and agrees_with_step(stamps, dt / seconds):
            step = _uniform_step_or(dt / seconds, columns, time, seconds)
        else:
            step = uniform_step(stamps, time, columns.rows, seconds)
        known[f"column {time}"] = step * seconds
        start = None if time in columns.clocks else float(stamps[0]) * seconds
    if dt is not None:
        known["--dt (library: dt=)"] = float(dt)
    known |= {f"array {name}": seconds for name, seconds in table.stated(structure).items()}
    if not known:
        raise RecordError(_unknown_sampling_message(table, file, structure))
    return _reconcile(known, file), start


def _find_common_sampling(
    table: Table, parts: Sequence[Columns], time: str | None, dt: float | None, structure: str, given: bool
) -> tuple[float, float | None]:
    """Return the sampling time of all recordings of a file, and the time of the first sample."""
    file = parts[0].rows.file
    parts = [part for part in parts if len(part.rows) > 1]
    if not parts:
        raise RecordError(f"{file}: each sample has its header: delete the repeated headers")
    found = [find_sampling(table, part, time, dt, structure, given) for part in parts]
    known = {f"the rows from {part.rows.row(0)}": step for part, (step, _) in zip(parts, found, strict=True)}
    return _reconcile(known, file), found[0][1]


def make_recording(
    table: Table,
    columns: Columns,
    values: NDArray[np.float64],
    time: str | None,
    dt: float | None,
    structure: str = "",
    given: bool = False,
) -> Recording:
    """Return samples with their times, which may be irregular. Without a time column they are uniform.

    Parameters
    ----------
    values : ndarray, shape (samples, columns)
    table, columns, time, dt, structure, given
        As in `find_sampling`.

    Raises
    ------
    RecordError
        The sampling time is unknown.
    """
    if time is None:
        step, _ = find_sampling(table, columns, None, dt, structure)
        stamps = step * (columns.first + np.arange(len(values), dtype=np.float64))
        return Recording(columns.rows, stamps, values, "time", 1.0)
    seconds = time_scale(table, columns, time, structure, given)
    return Recording(columns.rows, columns.numbers[time], values, time, seconds)


def _uniform_step_or(step: float, columns: Columns, time: str, seconds: float) -> float:
    """Return the mean step of the time column if it is uniform, else the given step."""
    try:
        return uniform_step(columns.numbers[time], time, columns.rows, seconds)
    except RecordError:
        return step


def time_scale(table: Table, columns: Columns, time: str, structure: str = "", given: bool = False) -> float:
    """Return the unit of the numbers of a time column in seconds.

    Raises
    ------
    RecordError
        The unit is unknown.
    """
    if time in columns.clocks:
        return 1.0
    field = time.removeprefix(structure)
    seconds = 1.0 if given and not parse_unit(field) else seconds_per_unit(field)
    if seconds is None:
        raise RecordError(_unknown_sampling_message(table, columns.rows.file, structure))
    if not parse_unit(field):
        largest = float(np.nanmax(np.abs(columns.numbers[time]), initial=0.0))
        return next((unit for least, unit in _EPOCHS if largest >= least), seconds)
    return seconds


def _unknown_sampling_message(table: Table, file: str, structure: str) -> str:
    message = (
        f"{file} has no time column (t, t_s, time_ms ...): give the sampling time by --dt (library: "
        "dt=), or name the column by --time (library: time=)"
    )
    fields = {name: name.removeprefix(structure) for name in table.names}
    unknown_unit = [
        name for name, field in fields.items() if looks_like_time(field) and seconds_per_unit(field) is None
    ]
    if unknown_unit:
        units = ", ".join(unit for unit in TIME_UNITS if unit)
        message += f"; if {unknown_unit[0]} is the time, end its name in one of the units {units}"
    return message


def _reconcile(known: Mapping[str, float], file: str) -> float:
    """Return the first sampling time after checking that the others agree with it."""
    (source, first), *others = known.items()
    for other, seconds in others:
        if abs(seconds - first) > AGREEMENT * first:
            raise RecordError(
                f"{file}: the sampling time is {first:.6g} s by {source} and {seconds:.6g} s by {other}: "
                "correct one of them"
            )
    return first
