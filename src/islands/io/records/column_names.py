"""Column names: units, structures and the time column."""

import re
from collections import Counter
from collections.abc import Collection, Iterable

from islands.data.channel_names import AT_ONCE, parse_unit
from islands.errors import RecordError

#: Units of time columns in seconds. A column without a unit is in seconds.
TIME_UNITS = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}

#: Units with which a capital T means a temperature.
TEMPERATURE_UNITS = ("K", "C", "degC", "°C", "F", "degF", "°F")

_TIME = re.compile(r"t(_.*|\s*[\[(/].*)?|(?:time|zeit).*", re.IGNORECASE)

#: End of the name of a time column: its unit in any case, a number, or another word.
_END = re.compile(r"[_\[(/]\s*([^_\[\](/)]*?)\s*[\])]?$")


def split_structures(names: Iterable[str]) -> dict[str, str]:
    """Return the structure that contains each column: ``run_1.`` for ``run_1.u_V``, ``""`` at the top level.

    A structure has at least two fields; a single point may be part of a unit (``k_N.m``).
    """
    prefixes = {name: name[: name.rfind(".") + 1] for name in names}
    fields = Counter(prefixes.values())
    return {name: prefix if fields[prefix] > 1 else "" for name, prefix in prefixes.items()}


def find_column(name: str, columns: Iterable[str]) -> str:
    """Return the column of an input name: ``u_V`` for ``u_V+1``, unless a column has exactly that name."""
    return name if name in tuple(columns) else name.removesuffix(AT_ONCE)


def looks_like_time(name: str) -> bool:
    """Return whether a column's name is ``t``, ``t_*``, ``t/*``, ``time*`` or ``Zeit*``.

    ``T_K`` is a temperature.
    """
    return bool(_TIME.fullmatch(name)) and not (name[0] == "T" and parse_unit(name) in TEMPERATURE_UNITS)


def seconds_per_unit(name: str) -> float | None:
    """Return the unit of a time column in seconds, None if the unit is unknown."""
    end = _END.search(name)
    return TIME_UNITS.get("" if end is None or end[1].isdigit() else end[1].lower())


def time_column(
    names: Collection[str], file: str, taken: Collection[str] = (), structure: str = ""
) -> str | None:
    """Return the name of the time column, None if the file has no time column.

    ``t``, ``time`` and names with a unit of time take precedence over other words that begin with ``time``,
    so that a file may contain both ``timestamp`` and ``t_s``.

    Parameters
    ----------
    names : collection of str
        All columns of the file.
    file : str
        Name of the file, for the message.
    taken : collection of str
        Inputs and output; they are never the time.
    structure : str
        The structure of the output (see `split_structures`). A time column among its fields takes precedence
        over one at the top level; fields of other structures are ignored.

    Raises
    ------
    RecordError
        Several columns may be the time.
    """
    structures = split_structures(names)
    for scope in dict.fromkeys((structure, "")):
        fields = {
            name: name.removeprefix(scope)
            for name in names
            if structures[name] == scope and name not in taken
        }
        candidates = [
            name
            for name, field in fields.items()
            if looks_like_time(field) and seconds_per_unit(field) is not None
        ]
        preferred = [
            name for name in candidates if fields[name].lower() in {"t", "time"} or parse_unit(fields[name])
        ] or candidates
        if len(preferred) > 1:
            raise RecordError(
                f"{file}: columns {' and '.join(preferred)} may all be the time: rename all but one"
            )
        if preferred:
            return preferred[0]
    return None
