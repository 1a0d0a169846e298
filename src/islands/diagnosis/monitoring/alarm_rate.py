"""Rates of false alarms as text: ``1 per month``, ``0.5/week``, ``1 per 720 records``."""

import re
from collections.abc import Mapping
from types import MappingProxyType

from islands.errors import SettingsError, suggest

#: Units of time in seconds. A month has 30 days.
SECONDS: Mapping[str, float] = MappingProxyType(
    {"hour": 3600.0, "day": 86400.0, "week": 604800.0, "month": 2592000.0, "year": 31536000.0}
)

_RATE = re.compile(r"([\d.eE+-]+)\s*(?:per|/)\s*([\d.]+\s+)?([a-z]+?)s?")


def parse_alarm_rate(text: str, interval: float) -> float:
    """Return the rate of false alarms per record.

    Parameters
    ----------
    text : str
        ``NUMBER per [NUMBER] UNIT``, where the unit is record, hour, day, week, month or year.
    interval : float
        Time from one record to the next, in seconds.

    Raises
    ------
    SettingsError
        The text is no rate, or the rate is not between 0 and 1 per record.
    """
    match = _RATE.fullmatch(text.strip().lower())
    number, every, unit = match.groups() if match else ("", "", "")
    known = ("record", *SECONDS)
    try:
        count = float(number) / float(every or 1.0)
        per_record = count / (1.0 if unit == "record" else SECONDS[unit] / interval)
    except (KeyError, ValueError, ZeroDivisionError):
        raise SettingsError(
            f"{text!r} is no rate of false alarms: write NUMBER per UNIT, such as 1 per month or 1 per 720 "
            f"records; the units are {', '.join(known)}"
            f"{suggest(unit, known) if match else ''}"
        ) from None
    if not 0.0 < per_record < 1.0:
        raise SettingsError(
            f"{text!r} is {per_record:g} false alarms per record, with a record every {interval:g} s: give a "
            "rate above 0 and below 1 per record"
        )
    return per_record
