"""Uniform grid of a time column, and what deviates from it: repeated stamps, jumps, gaps, jitter."""

from decimal import Decimal
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, join_text, name_option
from islands.records.reading.table import RowRange

#: Tolerance relative to a step: deviation of time stamps from the grid, and difference of two sampling times.
AGREEMENT = 0.01

#: Largest rounding of printed time stamps that is accepted, relative to a step. From half a step on, a
#: missing sample would look like rounding; five printed digits at 5 kHz and 10 s need a quarter.
ROUNDING = 0.25

#: Steps longer than this many usual steps are gaps.
GAP = 1.5

#: Relative difference of two deviations of steps that is a rounding error.
_EQUAL = 1e-6

#: Seconds by which clocks change for summer time.
_SUMMER = 3600.0


def uniform_step(stamps: NDArray[np.float64], name: str, rows: RowRange, seconds: float = 1.0) -> float:
    """Return the mean step of a uniform time column, in the column's unit.

    Parameters
    ----------
    stamps : ndarray, shape (samples,)
        At least two finite time stamps.
    name, rows
        The column and its position in the file, for the message.
    seconds : float
        The column's unit in seconds, for the sampling time in the message.

    Raises
    ------
    RecordError
        A stamp is repeated or goes backwards, samples are missing, or the sampling is jittered.
    """
    steps = np.diff(stamps)
    if not (steps > 0).all():
        _raise_not_increasing(stamps, name, rows)
    step = float(stamps[-1] - stamps[0]) / (len(stamps) - 1)
    deviation = np.abs(stamps - fit_line(stamps))
    if deviation.max() <= AGREEMENT * step:
        return step
    excess = deviation - allowed_deviation(stamps, step)
    if (excess > 0).any():
        _raise_not_uniform(stamps, int(np.argmax(excess)), name, rows, seconds)
    return step


def allowed_deviation(stamps: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Return how far every stamp may be from the grid: `AGREEMENT`, and the rounding of printed numbers."""
    allowed: NDArray[np.float64] = AGREEMENT * step + np.minimum(rounding_error(stamps), ROUNDING * step)
    return allowed


def agrees_with_step(stamps: NDArray[np.float64], step: float) -> bool:
    """Return whether stamps with jitter or coarse rounding belong to samples with a given uniform step.

    The stamps never decrease, their mean step is the given one, and no stamp is further from the grid than
    half a step and the resolution of the stamps: a missing sample would be.
    """
    steps = np.diff(stamps)
    rounding = 2.0 * float(rounding_error(stamps).max())
    if (steps == 0).any():  # Several samples have the same stamp if the clock counts longer steps.
        counted = float(steps[steps > 0].min(initial=np.inf))
        rounding = max(rounding, counted if GAP * step < counted < np.inf else 0.0)
    slope = float(np.polyfit(np.arange(len(stamps)) - len(stamps) / 2, stamps - stamps.mean(), 1)[0])
    return bool(
        (steps >= 0).all()
        and abs(slope - step) <= AGREEMENT * step + 2.0 * rounding / len(stamps)
        and np.abs(stamps - fit_line(stamps)).max() <= 0.5 * step + rounding
    )


def fit_line(stamps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fit a uniform grid by least squares; the line through both ends would contain their rounding errors."""
    centred = np.arange(len(stamps), dtype=np.float64) - (len(stamps) - 1) / 2
    middle = stamps.mean()
    line: NDArray[np.float64] = middle + centred * (centred @ (stamps - middle) / (centred @ centred))
    return line


def rounding_error(stamps: NDArray[np.float64]) -> NDArray[np.float64]:
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


def describe_gaps(stamps: NDArray[np.float64], rows: RowRange, gap: NDArray[np.bool_]) -> str:
    """Return the number of gaps and the longest one: ``3 gaps, the longest of 0.5 before line 120``."""
    steps = np.where(gap, np.diff(stamps), 0.0)
    longest, count = int(np.argmax(steps)), int(gap.sum())
    if count == 1:
        return f"a gap of {steps[longest]:.6g} before {rows.row(longest + 1)}"
    return f"{count} gaps, the longest of {steps[longest]:.6g} before {rows.row(longest + 1)}"


def _raise_not_increasing(stamps: NDArray[np.float64], name: str, rows: RowRange) -> NoReturn:
    steps = np.diff(stamps)
    wrong = steps <= 0
    sample = int(np.argmax(wrong)) + 1
    previous, current = stamps[sample - 1], stamps[sample]
    others = f" ({int(wrong.sum())} of {len(stamps)} rows do)" if wrong.sum() > 1 else ""
    if current == previous:
        problem = f"repeats the time stamp {previous:.10g}{others}"
        advice = join_text(
            "give ",
            name_option("resample", example="DT"),
            ", which averages rows of equal time, or, if only the printed time is too coarse, ",
            name_option("dt", example="DT"),
        )
    else:
        problem = f"jumps back to {current:.10g} from {previous:.10g}{others}"
        split = name_option("gaps", "split")
        advice = join_text("if several recordings follow one another, give ", split, " for segments")
        usual = float(np.median(steps))
        if abs(previous - current + usual - _SUMMER) <= max(usual, 1.0):
            zone = name_option("timezone", example="Europe/Berlin")
            advice = join_text("if it is the end of summer time, give the time zone, as ", zone)
    raise RecordError(join_text(f"{rows.place(sample, name)} {problem}: ", advice))


def _raise_not_uniform(
    stamps: NDArray[np.float64], sample: int, name: str, rows: RowRange, seconds: float
) -> NoReturn:
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    gaps, others = steps > GAP * usual, ""
    if 0 < gaps.mean() < 0.1:
        sample = int(np.argmax(gaps)) + 1
        problem = "follows a gap: the time changes"
        advice = join_text(
            f"{describe_gaps(stamps, rows, gaps)}; give ",
            name_option("gaps", "split"),
            " for segments or ",
            name_option("gaps", "interpolate"),
            " to fill them",
        )
        if abs(steps[sample - 1] - usual - _SUMMER) <= max(usual, 1.0):
            zone = name_option("timezone", example="Europe/Berlin")
            advice = join_text(
                advice, "; if it is the beginning of summer time, give the time zone, as ", zone
            )
    else:
        # The stamp that is farthest from the grid may be far behind the steps that moved it.
        rounding = rounding_error(stamps)
        off = np.abs(steps - usual) - rounding[1:] - rounding[:-1]
        count = int(np.count_nonzero(off > AGREEMENT * usual))
        sample = int(np.argmax(off >= (1.0 - _EQUAL) * off.max())) + 1 if count else max(sample, 1)
        others = f" ({count} of {len(steps)} steps differ)" if count > 1 else ""
        problem = "is off the uniform grid: the time changes"
        advice = join_text(
            "give ",
            name_option("resample", usual * seconds),
            " to interpolate onto a uniform grid, or, if the samples are uniform and only their time stamps "
            "are not, ",
            name_option("dt", usual * seconds),
        )
    raise RecordError(
        join_text(
            f"{rows.place(sample, name)} {problem} from {stamps[sample - 1]:.10g} to "
            f"{stamps[sample]:.10g}, but the usual step is {usual:.6g}{others}: ",
            advice,
        )
    )
