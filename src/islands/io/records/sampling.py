"""The sampling time of a record: from a time column that is held against a uniform grid, or as stated."""

from collections.abc import Mapping
from decimal import Decimal
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.io.records.column_names import TIME_UNITS, looks_like_time, parse_unit, seconds_per_unit
from islands.io.records.table import Columns, RowRange, Table

#: Part of a step by which time stamps may leave the grid, and by which two sampling times may differ.
AGREEMENT = 0.01

#: Part of a step that the rounding of printed time stamps may take up. From half a step on a missing sample
#: would pass for rounding; a quarter is what five printed digits cost at 5 kHz and 10 s.
ROUNDING = 0.25


def find_sampling(
    table: Table, columns: Columns, time: str | None, dt: float | None, structure: str = ""
) -> tuple[float, float | None]:
    """Return the sampling time and the first sample's time in seconds, None where no column tells it.

    Parameters
    ----------
    table, columns
        The file, and its columns that were read.
    time : str or None
        The time column.
    dt : float or None
        The sampling time that the user gives, in seconds.
    structure : str
        The structure of the output: what it states goes before what stands at the top.

    Raises
    ------
    RecordError
        The time column is not uniform, nothing tells the sampling time, or two sources disagree.
    """
    file = columns.rows.file
    known: dict[str, float] = {}
    start = None
    if time is not None:
        stamps = columns.numbers[time]
        seconds = TIME_UNITS[parse_unit(time.removeprefix(structure)).lower()]
        known[f"column {time}"] = uniform_step(stamps, time, columns.rows) * seconds
        start = float(stamps[0]) * seconds
    if dt is not None:
        if not (np.isfinite(dt) and dt > 0):
            raise RecordError(
                f"the sampling time --dt (library: dt=) is a positive number of seconds, got {dt}"
            )
        known["--dt (library: dt=)"] = float(dt)
    known |= {f"array {name}": seconds for name, seconds in table.stated(structure).items()}
    if not known:
        raise RecordError(_nothing_known(table, file, structure))
    return _agreed(known, file), start


def uniform_step(stamps: NDArray[np.float64], name: str, rows: RowRange) -> float:
    """Return the step of a uniform time column, in the column's unit, from its first to its last stamp.

    Parameters
    ----------
    stamps : ndarray, shape (samples,)
        At least two, finite.
    name, rows
        The column and its place in the file, for the message.

    Raises
    ------
    RecordError
        A stamp is repeated or goes backwards, samples are missing, or the sampling is jittered.
    """
    steps = np.diff(stamps)
    if not (steps > 0).all():
        _refuse_standstill(stamps, int(np.argmin(steps > 0)) + 1, name, rows)
    step = float(stamps[-1] - stamps[0]) / (len(stamps) - 1)
    deviation = np.abs(stamps - _fitted_line(stamps))
    if deviation.max() <= AGREEMENT * step:
        return step
    allowed = AGREEMENT * step + np.minimum(_rounding(stamps), ROUNDING * step)
    if (deviation > allowed).any():
        _refuse_uneven(stamps, int(np.argmax(deviation - allowed)), name, rows)
    return step


def _fitted_line(stamps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fit the grid by least squares: the end-to-end line would carry the rounding of both ends."""
    centred = np.arange(len(stamps), dtype=np.float64) - (len(stamps) - 1) / 2
    middle = stamps.mean()
    line: NDArray[np.float64] = middle + centred * (centred @ (stamps - middle) / (centred @ centred))
    return line


def _rounding(stamps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return half a unit of the last digit with which every stamp was written.

    Printed numbers keep either a number of decimals or a number of digits; the column's longest number tells
    both, and the coarser holds. Numbers that single precision holds exactly may have been rounded to it.
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


def _refuse_standstill(stamps: NDArray[np.float64], sample: int, name: str, rows: RowRange) -> NoReturn:
    before, now = stamps[sample - 1], stamps[sample]
    what = "repeats the time stamp" if now == before else f"jumps back to {now:.10g} from"
    raise RecordError(
        f"{rows.place(sample, name)} {what} {before:.10g}: resample to a uniform grid, or, if several "
        "recordings follow one another, pass them as segments (islands.join, or a file or rows for each)"
    )


def _refuse_uneven(stamps: NDArray[np.float64], sample: int, name: str, rows: RowRange) -> NoReturn:
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    gaps = steps > 1.5 * usual
    if 0 < gaps.mean() < 0.1:
        sample = int(np.argmax(gaps)) + 1
        what = "stands behind a gap: time goes"
        advice = (
            "fill it by resampling to a uniform grid, or pass what lies before and after as segments "
            "(islands.join, or a file or rows for each)"
        )
    else:
        sample = max(sample, 1)
        what = "is off the uniform grid: time goes"
        advice = (
            "resample the record to a uniform grid; if only the printed time is too coarse, leave the column "
            "out and give --dt (library: dt=)"
        )
    raise RecordError(
        f"{rows.place(sample, name)} {what} from {stamps[sample - 1]:.10g} to {stamps[sample]:.10g} where "
        f"the usual step is {usual:.6g}: {advice}"
    )


def _nothing_known(table: Table, file: str, structure: str) -> str:
    message = (
        f"{file} has no time column (t, t_s, time_ms ...): give the sampling time by --dt (library: dt=)"
    )
    own = {name: name.removeprefix(structure) for name in table.names}
    strange = [name for name in own if looks_like_time(own[name]) and seconds_per_unit(own[name]) is None]
    if strange:
        units = ", ".join(unit for unit in TIME_UNITS if unit)
        message += f", or, if {strange[0]} is the time, end its name in one of the units {units}"
    return message


def _agreed(known: Mapping[str, float], file: str) -> float:
    """Return the first of the sampling times, with which the others have to agree."""
    (source, first), *others = known.items()
    for other, seconds in others:
        if abs(seconds - first) > AGREEMENT * first:
            raise RecordError(
                f"{file}: the sampling time is {first:.6g} s by {source} and {seconds:.6g} s by {other}: "
                "correct one of them"
            )
    return first
