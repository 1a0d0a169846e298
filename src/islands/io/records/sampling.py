"""Sampling time of a record, from a time column that is checked against a uniform grid or as stated."""

from collections.abc import Mapping
from decimal import Decimal
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.io.records.column_names import TIME_UNITS, looks_like_time, seconds_per_unit
from islands.io.records.table import Columns, RowRange, Table

#: Tolerance relative to a step: deviation of time stamps from the grid, and difference of two sampling times.
AGREEMENT = 0.01

#: Largest rounding of printed time stamps that is accepted, relative to a step. From half a step on, a
#: missing sample would look like rounding; five printed digits at 5 kHz and 10 s need a quarter.
ROUNDING = 0.25


def find_sampling(
    table: Table, columns: Columns, time: str | None, dt: float | None, structure: str = ""
) -> tuple[float, float | None]:
    """Return the sampling time and the time of the first sample in seconds.

    The latter is None if there is no time column.

    Parameters
    ----------
    table, columns
        The file and the columns read from it.
    time : str or None
        The time column.
    dt : float or None
        The sampling time given by the user, in seconds.
    structure : str
        The structure of the output. A sampling time stated in it takes precedence over one at the top level.

    Raises
    ------
    RecordError
        The time column is not uniform, the sampling time is unknown, or two sources disagree.
    """
    file = columns.rows.file
    known: dict[str, float] = {}
    start = None
    if time is not None:
        stamps = columns.numbers[time]
        seconds = seconds_per_unit(time.removeprefix(structure))
        if seconds is None:
            raise RecordError(_unknown_sampling_message(table, file, structure))
        known[f"column {time}"] = uniform_step(stamps, time, columns.rows) * seconds
        start = float(stamps[0]) * seconds
    if dt is not None:
        if not (np.isfinite(dt) and dt > 0):
            raise RecordError(
                f"the sampling time --dt (library: dt=) must be a positive number of seconds, got {dt}"
            )
        known["--dt (library: dt=)"] = float(dt)
    known |= {f"array {name}": seconds for name, seconds in table.stated(structure).items()}
    if not known:
        raise RecordError(_unknown_sampling_message(table, file, structure))
    return _reconcile(known, file), start


def uniform_step(stamps: NDArray[np.float64], name: str, rows: RowRange) -> float:
    """Return the mean step of a uniform time column, in the column's unit.

    Parameters
    ----------
    stamps : ndarray, shape (samples,)
        At least two finite time stamps.
    name, rows
        The column and its position in the file, for the message.

    Raises
    ------
    RecordError
        A stamp is repeated or goes backwards, samples are missing, or the sampling is jittered.
    """
    steps = np.diff(stamps)
    if not (steps > 0).all():
        _raise_not_increasing(stamps, int(np.argmin(steps > 0)) + 1, name, rows)
    step = float(stamps[-1] - stamps[0]) / (len(stamps) - 1)
    deviation = np.abs(stamps - _fit_line(stamps))
    if deviation.max() <= AGREEMENT * step:
        return step
    allowed = AGREEMENT * step + np.minimum(_rounding_error(stamps), ROUNDING * step)
    if (deviation > allowed).any():
        _raise_not_uniform(stamps, int(np.argmax(deviation - allowed)), name, rows)
    return step


def _fit_line(stamps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fit a uniform grid by least squares; the line through both ends would contain their rounding errors."""
    centred = np.arange(len(stamps), dtype=np.float64) - (len(stamps) - 1) / 2
    middle = stamps.mean()
    line: NDArray[np.float64] = middle + centred * (centred @ (stamps - middle) / (centred @ centred))
    return line


def _rounding_error(stamps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return half a unit of the last printed digit of every stamp.

    Numbers are printed with a fixed number of decimals or of significant digits. The column's longest number
    gives both, and the coarser of the two applies. Numbers that single precision represents exactly may have
    been rounded to single precision.
    """
    parts = [Decimal(repr(stamp)).normalize().as_tuple() for stamp in stamps.tolist()]
    digits = max(len(part.digits) for part in parts)
    lowest = min(int(part.exponent) for part in parts)
    magnitude = np.floor(np.log10(np.maximum(np.abs(stamps), np.finfo(np.float64).tiny)))
    half_unit = 0.5 * np.maximum(10.0**lowest, 10.0 ** (magnitude + 1 - digits))
    with np.errstate(over="ignore"):
        single = stamps.astype(np.float32)
    if np.array_equal(single, stamps):
        half_unit = np.maximum(half_unit, 0.5 * np.spacing(np.abs(single)).astype(np.float64))
    return half_unit


def _raise_not_increasing(stamps: NDArray[np.float64], sample: int, name: str, rows: RowRange) -> NoReturn:
    previous, current = stamps[sample - 1], stamps[sample]
    problem = "repeats the time stamp" if current == previous else f"jumps back to {current:.10g} from"
    raise RecordError(
        f"{rows.place(sample, name)} {problem} {previous:.10g}: resample to a uniform grid, or, if several "
        "recordings follow one another, pass them as segments (islands.join, or a file or rows for each)"
    )


def _raise_not_uniform(stamps: NDArray[np.float64], sample: int, name: str, rows: RowRange) -> NoReturn:
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    gaps = steps > 1.5 * usual
    if 0 < gaps.mean() < 0.1:
        sample = int(np.argmax(gaps)) + 1
        problem = "follows a gap: the time changes"
        advice = (
            "fill it by resampling to a uniform grid, or pass the parts before and after it as segments "
            "(islands.join, or a file or rows for each)"
        )
    else:
        sample = max(sample, 1)
        problem = "is off the uniform grid: the time changes"
        advice = (
            "resample the record to a uniform grid; if only the printed time is too coarse, leave the column "
            "out and give --dt (library: dt=)"
        )
    raise RecordError(
        f"{rows.place(sample, name)} {problem} from {stamps[sample - 1]:.10g} to {stamps[sample]:.10g}, but "
        f"the usual step is {usual:.6g}: {advice}"
    )


def _unknown_sampling_message(table: Table, file: str, structure: str) -> str:
    message = (
        f"{file} has no time column (t, t_s, time_ms ...): give the sampling time by --dt (library: dt=)"
    )
    fields = {name: name.removeprefix(structure) for name in table.names}
    unknown_unit = [
        name for name, field in fields.items() if looks_like_time(field) and seconds_per_unit(field) is None
    ]
    if unknown_unit:
        units = ", ".join(unit for unit in TIME_UNITS if unit)
        message += f", or, if {unknown_unit[0]} is the time, end its name in one of the units {units}"
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
