"""Time stamps of a text table: dates, times of day, and both, converted to elapsed seconds.

Stamps are compared as integers of nanoseconds, because seconds since 1970 with nanoseconds exceed float64.
"""

import re
import reprlib
from collections.abc import Collection, Sequence
from datetime import UTC, date, datetime, timedelta
from functools import lru_cache
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, join_text, name_option
from islands.records.reading.formats.text.missing_words import is_missing
from islands.records.reading.table import RowRange

_DATE = (
    r"(?:(?P<year>\d{4})(?P<dash>[-/.])(?P<month>\d{1,2})(?P=dash)(?P<day>\d{1,2})"
    r"|(?P<one>\d{1,2})(?P<mark>[./-])(?P<two>\d{1,2})(?P=mark)(?P<last>\d{4}|(?<!-)\d\d)"
    r"|(?P<named_day>\d{1,2})[-./ ]+(?P<name>[^\W\d_]{3,9})\.?[-./, ]+(?P<named_year>\d{4}))"
)
_TIME = (
    r"(?:(?P<hour>\d{1,4}):(?P<minute>[0-5]\d)(?::(?P<second>[0-5]\d|60)(?:[.,:](?P<part>\d{1,12}))?)?"
    r"|(?P<minutes>\d{1,3}):(?P<seconds>[0-5]\d)[.,](?P<fraction>\d{1,12}))"
    r"(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
)
_ZONE = r"(?:\s*(?P<zone>Z|UTC|GMT|[+-]\d\d(?::?\d\d)?))?"
_DATED = re.compile(rf"\s*{_DATE}(?:(?:\s*[Tt,;_]\s*|\s+){_TIME}{_ZONE})?\s*")
_TIMED = re.compile(rf"\s*{_TIME}{_ZONE}\s*")

#: ISO 8601 without separators: 20261122T140503.25.
_BASIC = re.compile(r"^\s*(\d{4})(\d\d)(\d\d)[Tt](\d\d)(\d\d)(\d\d)")

#: Beginnings of the names of months in English and German.
_MONTHS = {
    "jan": 1,
    "feb": 2,
    "mar": 3,
    "apr": 4,
    "may": 5,
    "jun": 6,
    "jul": 7,
    "aug": 8,
    "sep": 9,
    "oct": 10,
    "nov": 11,
    "dec": 12,
    "mär": 3,
    "mrz": 3,
    "mai": 5,
    "okt": 10,
    "dez": 12,
}

_EPOCH = date(1970, 1, 1).toordinal()
_SECOND = 10**9
_HOUR = 3600 * _SECOND
_DAY = 24 * _HOUR

#: Kinds of time stamps.
DATED, DATE_ONLY, TIME_ONLY = "date and time", "date", "time"


def find_kind(texts: Sequence[str], missing: Collection[str] = ()) -> str:
    """Return the kind of time stamps that a column contains; empty if it contains none."""
    kinds = {kind_of(text) for text in texts if not is_missing(text, missing)}
    return kinds.pop() if len(kinds) == 1 else ""


def kind_of(text: str) -> str:
    """Return the kind of a time stamp; empty if the text is none."""
    if _TIMED.fullmatch(text):
        return TIME_ONLY
    match = _DATED.fullmatch(_BASIC.sub(r"\1-\2-\3T\4:\5:\6", text))
    if match is None:
        return ""
    return DATED if match["hour"] or match["minutes"] else DATE_ONLY


def parse_stamps(
    texts: Sequence[str],
    name: str,
    rows: RowRange,
    order: str | None,
    timezone: str | None,
    missing: Collection[str] = (),
) -> NDArray[np.float64]:
    """Convert time stamps to seconds after the first one, shape (samples,). Missing cells become NaN.

    Times of day that continue after midnight belong to the next day. The repeated hour at the end of summer
    time is resolved by the order of the samples.

    Parameters
    ----------
    texts : sequence of str
        The cells.
    name, rows
        The column and its position in the file, for messages.
    order : str or None
        ``day-first`` or ``month-first`` for dates such as 3/4/2026; by default inferred from all dates.
    timezone : str or None
        Time zone of stamps without an offset.
    missing : collection of str
        Words of the user for a missing value, in lower case.

    Raises
    ------
    RecordError
        A cell is not a time stamp, or the order of day and month is not certain.
    """
    matches = [
        None if is_missing(text, missing) else _match(text, name, sample, rows)
        for sample, text in enumerate(texts)
    ]
    day_first = _is_day_first(matches, name, rows, order)
    zone = None if timezone is None else ZoneInfo(timezone)
    moments: list[int | None] = []
    before: int | None = None
    for sample, match in enumerate(matches):
        moment = None
        if match is not None:
            try:
                moment = _to_moment(match, day_first, zone, before)
            except ValueError as error:
                raise RecordError(
                    f"{rows.place(sample, name)}: {texts[sample].strip()!r} is not a time stamp "
                    f"({error}): correct the cell or leave its row out"
                ) from None
            before = moment
        moments.append(moment)
    first = next((moment for moment in moments if moment is not None), 0)
    return np.array([np.nan if moment is None else (moment - first) / _SECOND for moment in moments])


def _match(text: str, name: str, sample: int, rows: RowRange) -> re.Match[str]:
    match = _TIMED.fullmatch(text) or _DATED.fullmatch(_BASIC.sub(r"\1-\2-\3T\4:\5:\6", text))
    if match is None:
        raise RecordError(
            f"{rows.place(sample, name)}: {reprlib.repr(text.strip())} is not a time stamp as in the "
            "other rows: correct the cell or leave its row out"
        )
    return match


def _is_day_first(
    matches: Sequence[re.Match[str] | None], name: str, rows: RowRange, order: str | None
) -> bool:
    """Return whether the day precedes the month in dates such as 3/4/2026. A point always follows a day.

    If no day exceeds 12, it is the order with which the time goes on at midnight, in a record without gaps.
    """
    if order is not None:
        return order == "day-first"
    dates: dict[tuple[str, str, str], int] = {}
    for sample, match in enumerate(matches):
        if match is not None and match.re is _DATED and match["one"] and match["mark"] != ".":
            dates.setdefault((match["one"], match["two"], match["last"]), sample)
    day_first = next((sample for (one, _, _), sample in dates.items() if int(one) > 12), None)
    month_first = next((sample for (_, two, _), sample in dates.items() if int(two) > 12), None)
    if day_first is not None and month_first is not None:
        raise RecordError(
            f"column {name} has the day first in {rows.file}, {rows.row(day_first)} and the month first in "
            f"{rows.row(month_first)}: write all dates in the same way, for example 2026-11-22"
        )
    # The order does not affect elapsed times within a day, or if day and month are equal.
    if day_first is None and month_first is None and len(dates) > 1:
        continuous = [order for order in (True, False) if _is_continuous(matches, order)]
        if len(continuous) == 1:
            return continuous[0]
        one, two, year = next(iter(dates))
        raise RecordError(
            join_text(
                f"{rows.place(next(iter(dates.values())), name)}: {one}/{two}/{year} may be the day {one} "
                f"of the month {two} or the reverse, and no other date tells: give ",
                name_option("dates", "day-first"),
                " or ",
                name_option("dates", "month-first"),
            )
        )
    return month_first is None


def _is_continuous(matches: Sequence[re.Match[str] | None], day_first: bool) -> bool:
    """Return whether the time goes on with about its usual step wherever the date changes.

    Most steps have to be within a day: dates alone may be days as well as first days of months.
    """
    known = [match for match in matches if match is not None]
    try:
        days = np.array([_date_of(match, day_first) for match in known])
        moments = np.array([_to_moment(match, day_first, None, None) for match in known])
    except ValueError:
        return False
    steps, changes = np.abs(np.diff(moments)), np.diff(days) != 0
    usual = np.median(steps)
    return bool(2 * changes.sum() <= steps.size and usual > 0 and steps[changes].max() <= 2 * usual)


def _to_moment(match: re.Match[str], day_first: bool, zone: ZoneInfo | None, before: int | None) -> int:
    """Return nanoseconds since 1970 in UTC, or in local time without a zone, or since midnight."""
    moment = _time_of(match)
    dated = match.re is _DATED
    if dated:
        moment += _date_of(match, day_first) * _DAY
    offset = _offset_of(match["zone"])
    if offset is not None:
        return moment - offset
    if dated and zone is not None:
        # The second of two equal local times, if the first one is not after the sample before.
        moments = [moment - _zone_offset(moment // (900 * _SECOND), zone, fold) for fold in (0, 1)]
        return moments[1] if before is not None and moments[0] <= before else moments[0]
    if not dated and before is not None and moment < before:
        days = (before - moment + _DAY // 2) // _DAY
        moment += days * _DAY
    return moment


def _time_of(match: re.Match[str]) -> int:
    if match["minutes"]:
        return (int(match["minutes"]) * 60 + int(match["seconds"])) * _SECOND + _part(match["fraction"])
    if not match["hour"]:
        return 0
    hour = int(match["hour"])
    if match["half"]:
        if not 1 <= hour <= 12:
            raise ValueError("hours with AM or PM are 1 to 12")
        hour = hour % 12 + 12 * (match["half"] in "pP")
    if match.re is _DATED and hour > 24:
        raise ValueError("the hour must be in 0..24")
    seconds = hour * 3600 + int(match["minute"]) * 60 + int(match["second"] or 0)
    return seconds * _SECOND + _part(match["part"])


def _part(digits: str | None) -> int:
    return int((digits or "0").ljust(9, "0")[:9])


def _date_of(match: re.Match[str], day_first: bool) -> int:
    """Return the days since 1970."""
    if match["year"]:
        parts = int(match["year"]), int(match["month"]), int(match["day"])
    elif match["name"]:
        month = _MONTHS.get(match["name"].lower()[:3])
        if month is None:
            raise ValueError(f"{match['name']} is not a month")
        parts = int(match["named_year"]), month, int(match["named_day"])
    else:
        one, two, year = int(match["one"]), int(match["two"]), int(match["last"])
        year += 2000 if len(match["last"]) == 2 else 0
        parts = (year, two, one) if day_first or match["mark"] == "." else (year, one, two)
    return _ordinal(*parts)


@lru_cache(64)
def _ordinal(year: int, month: int, day: int) -> int:
    return date(year, month, day).toordinal() - _EPOCH


def _offset_of(zone: str | None) -> int | None:
    if zone is None:
        return None
    if zone[0] not in "+-":
        return 0
    digits = zone[1:].replace(":", "").ljust(4, "0")
    offset = int(digits[:2]) * _HOUR + int(digits[2:]) * _HOUR // 60
    return -offset if zone[0] == "-" else offset


@lru_cache(4096)
def _zone_offset(quarter: int, zone: ZoneInfo, fold: int) -> int:
    """Return the offset from UTC at a quarter of an hour of local time, in nanoseconds."""
    local = datetime(1970, 1, 1, tzinfo=UTC).replace(tzinfo=None) + timedelta(minutes=15 * quarter)
    offset = local.replace(tzinfo=zone, fold=fold).utcoffset()
    assert offset is not None
    return round(offset.total_seconds()) * _SECOND
