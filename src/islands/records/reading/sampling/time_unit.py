"""Unit of the numbers of a time column: that of its name, a given one, or that of a known count of a date.

Spreadsheets, MATLAB and LabVIEW store a date as a number: days or seconds since an origin. Such
numbers are recognised by their size. A count of days has the size of an ordinary number of seconds: it is
recognised by its header, and by a step that is a usual time in days and not in seconds.
"""

import re
from dataclasses import dataclass
from datetime import datetime, timedelta
from math import ceil, log10

import numpy as np
from numpy.typing import NDArray

from islands.records.channel_names import parse_unit
from islands.records.reading.column_names import TIME_UNITS, seconds_per_unit, states_unit
from islands.records.reading.sampling.uniform_grid import GAP, rounding_error

_DAY = 86_400.0


@dataclass(frozen=True, slots=True)
class _DateCount:
    """A way to write dates as numbers, of the years from 1990 to 2060.

    Attributes
    ----------
    unit : str
        Unit of the numbers in words.
    seconds : float
        The unit in seconds.
    zero : float
        Number of 1970-01-01.
    name : str
        Where the count is usual.
    """

    unit: str
    seconds: float
    zero: float
    name: str

    def contains(self, low: float, high: float) -> bool:
        """Return whether numbers are dates of these years."""
        least, most = (self.zero + days * _DAY / self.seconds for days in (7_305, 32_872))
        return least <= low and high <= most

    def date(self, number: float) -> str:
        """Return the date of a number: ``2025-11-26 12:00:00``."""
        moment = datetime(1970, 1, 1) + timedelta(seconds=round((number - self.zero) * self.seconds))
        return moment.isoformat(" ")


#: Counts by days. The 1904 date system of Excel has the same unit; its dates are 1462 days later.
_DAYS = (
    _DateCount("days", _DAY, 25_569.0, "Excel"),
    _DateCount("days", _DAY, 719_529.0, "MATLAB"),
    _DateCount("days", _DAY, 40_587.0, "modified Julian dates"),
    _DateCount("days", _DAY, 2_440_587.5, "Julian dates"),
)

#: Counts whose numbers are too large for another unit.
_LARGE = (
    _DateCount("seconds", 1.0, 0.0, "Unix"),
    _DateCount("seconds", 1.0, 2_082_844_800.0, "LabVIEW"),
    _DateCount("ms", 1e-3, 0.0, "Unix"),
    _DateCount("us", 1e-6, 0.0, "Unix"),
    _DateCount("ticks of 100 ns", 1e-7, 116_444_736_000_000_000.0, "Windows"),
    # As nanoseconds of Unix these numbers are dates of 1990.
    _DateCount("ticks of 100 ns", 1e-7, 621_355_968_000_000_000.0, ".NET"),
    _DateCount("ns", 1e-9, 0.0, "Unix"),
)

#: Smallest numbers of other times since 1970 that cannot be seconds, and their units in seconds: 1e11 s are
#: 3000 years.
_EPOCHS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))

#: Words in names whose numbers are dates.
_DATE_WORDS = frozenset("date datetime datum fecha data excel ole serial datenum julian mjd jd".split())  # noqa: SIM905

#: Usual steps: decimals in seconds, also numbers of minutes, hours and days.
_DECIMAL_STEPS = (1.0, 2.0, 2.5, 4.0, 5.0, 8.0)
_CLOCK_STEPS = (1, 2, 2.5, 3, 4, 5, 6, 7, 7.5, 8, 9, 10, 12, 15, 20, 24, 30, 40, 45)

#: Times of day are less than this many days, and begin as many steps after midnight, to be read as such.
_MOST_DAYS_OF_TIME, _LATE = 2.0, 20.0

#: Numbers whose digits are counted, at most about.
_MOST_DIGITS = 5000

#: Tolerance of a usual step, and steps of whole seconds and milliseconds in which stamps with jitter count.
_STEP_TOLERANCE, _GRIDS = 2e-3, (1.0, 1e-3)


@dataclass(frozen=True, slots=True, eq=False)
class TimeScale:
    """Numbers of a time column with their unit.

    Attributes
    ----------
    stamps : ndarray, shape (samples,)
        The numbers; days of a date are seconds after the first one.
    seconds : float
        Unit of the stamps in seconds.
    elapsed : bool
        Whether the stamps are seconds after the first one.
    note : str
        The unit, if it was assumed and not stated; empty otherwise.
    """

    stamps: NDArray[np.float64]
    seconds: float
    elapsed: bool = False
    note: str = ""


def find_time_unit(
    numbers: NDArray[np.float64], name: str, given: bool = False, unit: str | None = None
) -> TimeScale | None:
    """Return a time column with its unit; None if the name ends in an unknown unit.

    Parameters
    ----------
    numbers : ndarray, shape (samples,)
        The column; NaN marks a missing stamp.
    name : str
        Name of the column in its structure.
    given : bool
        Whether the user has named the column: its name is then not expected to end in a unit of time.
    unit : str, optional
        Unit that the user has given, one of `TIME_UNITS`.
    """
    known = numbers[np.isfinite(numbers)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    calendar = None if unit is not None or states_unit(name) else _read_calendar(numbers, known, name)
    if calendar is not None:
        return calendar
    days = next((count for count in _DAYS if count.contains(low, high)), None)
    if unit is not None:
        is_date = days is not None and unit == "d"
        return _elapse(numbers, "") if is_date else TimeScale(numbers, TIME_UNITS[unit])
    seconds = 1.0 if given and not parse_unit(name) and not states_unit(name) else seconds_per_unit(name)
    if seconds is None or states_unit(name):
        return None if seconds is None else TimeScale(numbers, seconds)
    if days is not None and known.size > 1:
        return _read_days(numbers, known, name, days)
    if known.size > 1 and low >= 0.0 and high < _MOST_DAYS_OF_TIME:
        return _read_fractions(numbers, known, name, seconds)
    large = next((count for count in _LARGE if count.contains(low, high)), None)
    if large is not None:
        note = (
            f"column {name} is read as {large.unit} of a date: {low:.15g} is {large.date(low)} ({large.name})"
        )
        return TimeScale(numbers, large.seconds, note=note)
    largest = max(abs(low), abs(high))
    return TimeScale(numbers, next((step for least, step in _EPOCHS if largest >= least), seconds))


def _read_calendar(numbers: NDArray[np.float64], known: NDArray[np.float64], name: str) -> TimeScale | None:
    """Read numbers such as 20261127140503, a date and a time of day; None if they are none."""
    if not known.size or known.min() < 1.9e13 or known.max() >= 2.1e13 or (known != np.round(known)).any():
        return None
    days, clock = np.divmod(known.astype(np.int64), 1_000_000)
    year, month, day = days // 10_000, days // 100 % 100, days % 100
    hour, minute, second = clock // 10_000, clock // 100 % 100, clock % 100
    limits = ((month, 1, 12), (day, 1, 31), (hour, 0, 24), (minute, 0, 59), (second, 0, 60))
    if any((part < least).any() or (part > most).any() for part, least, most in limits):
        return None
    dates = (year - 1970).astype("datetime64[Y]").astype("datetime64[M]") + (month - 1)
    moments = (dates.astype("datetime64[D]") + (day - 1)).astype(np.int64) * int(_DAY)
    moments = moments + hour * 3600 + minute * 60 + second
    stamps = np.full(numbers.shape, np.nan)
    stamps[np.isfinite(numbers)] = moments - moments[0]
    note = f"column {name} is read as dates and times of day in the form YYYYMMDDhhmmss: {known[0]:.0f}"
    return TimeScale(stamps, 1.0, True, note)


def _read_days(
    numbers: NDArray[np.float64], known: NDArray[np.float64], name: str, count: _DateCount
) -> TimeScale:
    """Read numbers that may be dates in days or seconds as the likelier of both."""
    step, is_date = _usual_step(known), not _DATE_WORDS.isdisjoint(re.split(r"[\W_]+", name.lower()))
    in_seconds = _is_decimal_step(step) or _is_clock_step(step)
    in_days = _is_clock_step(step * _DAY)
    if not (in_seconds or in_days):
        in_days = _counts_time(known * _DAY, _DAY * _measure_rounding(known)) and not _counts_time(known)
    number = f"{known[0]:.15g} is {count.date(float(known[0]))} ({count.name})"
    if is_date or (in_days and not in_seconds):
        return _elapse(
            numbers,
            f"column {name} is read as days: {number}; if it is in seconds, give it the time unit s",
        )
    if in_seconds and not in_days:
        return TimeScale(numbers, 1.0)
    return TimeScale(
        numbers,
        1.0,
        note=f"column {name} is read as seconds; its numbers are also possible as days: {number}; if they "
        "are, give it the time unit d",
    )


def _read_fractions(
    numbers: NDArray[np.float64], known: NDArray[np.float64], name: str, seconds: float
) -> TimeScale:
    """Read small numbers, which may be times of day as fractions of a day in a spreadsheet.

    A record of seconds begins at zero, a time of day seldom does.
    """
    step = _usual_step(known)
    if known[0] < _LATE * step or _is_decimal_step(step) or not _is_clock_step(step * _DAY):
        return TimeScale(numbers, seconds)
    first = (datetime(1970, 1, 1) + timedelta(days=float(known[0]))).time()
    return _elapse(
        numbers,
        f"column {name} is read as fractions of a day: {known[0]:.10g} is {first:%H:%M:%S} (Excel); if it is "
        "in seconds, give it the time unit s",
    )


def _elapse(numbers: NDArray[np.float64], note: str) -> TimeScale:
    """Return dates in days as seconds after the first one, without the rounding errors of their last digits.

    A second is 1.2e-5 of a day. The seconds are rounded to the largest decimal that the digits resolve: whole
    seconds or milliseconds are exact again.
    """
    known = numbers[np.isfinite(numbers)]
    first = float(known[0]) if known.size else 0.0
    digits = -ceil(log10(2.0 * _DAY * _measure_rounding(known) * (1.0 - 1e-9))) if known.size else 0
    stamps: NDArray[np.float64] = np.round((numbers - first) * _DAY, min(max(digits, 0), 6))
    return TimeScale(stamps, 1.0, True, note)


def _measure_rounding(known: NDArray[np.float64]) -> float:
    """Return half a unit of the last digit of numbers of similar size, by some of them."""
    return float(rounding_error(known[:: 1 + len(known) // _MOST_DIGITS]).max())


def _usual_step(known: NDArray[np.float64]) -> float:
    """Return the mean of the steps that are not gaps: the median has the rounding errors of two stamps."""
    steps = np.diff(known)
    steps = steps[steps >= 0.0]
    longest = GAP * np.median(steps) + 2.1 * _measure_rounding(known) if steps.size else 0.0
    return float(steps[steps <= longest].mean()) if steps.size else 0.0


def _is_decimal_step(step: float) -> bool:
    if step <= 0.0:
        return False
    mantissa = step / 10.0 ** np.floor(np.log10(step))
    return any(abs(mantissa / usual - 1.0) <= _STEP_TOLERANCE for usual in (*_DECIMAL_STEPS, 10.0))


def _is_clock_step(seconds: float) -> bool:
    if 0.0 < seconds < 1.0 - _STEP_TOLERANCE:
        return _is_decimal_step(seconds)
    return any(
        abs(seconds / (usual * unit) - 1.0) <= _STEP_TOLERANCE
        for unit in (1.0, 60.0, 3600.0, _DAY)
        for usual in _CLOCK_STEPS
    )


def _counts_time(seconds: NDArray[np.float64], error: float = 1e-9) -> bool:
    """Return whether all times are whole seconds or milliseconds, within an error that is smaller."""
    allowed = np.maximum(error, np.spacing(np.abs(seconds)))
    return any(
        bool(
            (allowed < 0.05 * grid).all()
            and (np.abs(seconds - grid * np.round(seconds / grid)) <= allowed).all()
        )
        for grid in _GRIDS
    )
