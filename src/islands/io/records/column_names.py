"""What a column's name says: its unit, and whether the column is time."""

import re
from collections import Counter
from collections.abc import Collection, Iterable

from islands.errors import RecordError

#: Seconds of the units in which a time column may be given; a name without a unit is in seconds.
TIME_UNITS = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}

#: With one of these a capital T is a temperature.
TEMPERATURE_UNITS = ("K", "C", "degC", "°C", "F", "degF", "°F")

#: Behind an input's name: the column one sample early, for a system that answers within the sample.
AT_ONCE = "+1"

_TIME = re.compile(r"t(_.*|\s*[\[(].*)?|time.*", re.IGNORECASE)
_BRACKETED = re.compile(r".*[\[(]\s*([^\[\]()]*?)\s*[\])]")


def parse_unit(name: str) -> str:
    """Return the unit in a column's name: ``V`` of ``u_V``, ``u_est_V``, ``u [V]`` and ``u (V)``.

    It is what follows the last underscore, unless that is a bare number (``u_1``); ``""`` without one.
    """
    if bracketed := _BRACKETED.fullmatch(name):
        return bracketed[1]
    suffix = name.rpartition("_")[2] if "_" in name else ""
    return "" if suffix.isdigit() else suffix


def split_structures(names: Iterable[str]) -> dict[str, str]:
    """Return the structure in which each column is a field: ``run_1.`` of ``run_1.u_V``, ``""`` at the top.

    It takes two fields to make a structure: a point alone may belong to a unit (``k_N.m``).
    """
    before = {name: name[: name.rfind(".") + 1] for name in names}
    fields = Counter(before.values())
    return {name: structure if fields[structure] > 1 else "" for name, structure in before.items()}


def find_column(name: str, columns: Iterable[str]) -> str:
    """Return the column that an input names: ``u_V`` of ``u_V+1``, unless a column has the very name."""
    return name if name in tuple(columns) else name.removesuffix(AT_ONCE)


def looks_like_time(name: str) -> bool:
    """Tell whether a column is called ``t``, ``t_*`` or ``time*``; ``T_K`` is a temperature."""
    return bool(_TIME.fullmatch(name)) and not (name[0] == "T" and parse_unit(name) in TEMPERATURE_UNITS)


def seconds_per_unit(name: str) -> float | None:
    """Return the seconds of a time column's unit, None where the unit is unknown."""
    return TIME_UNITS.get(parse_unit(name).lower())


def time_column(
    names: Collection[str], file: str, taken: Collection[str] = (), structure: str = ""
) -> str | None:
    """Choose the time column; None where there is none.

    ``t``, ``time`` and names with a unit of time go before other words that begin with ``time``, so that a
    ``timestamp`` beside ``t_s`` does no harm.

    Parameters
    ----------
    names : collection of str
        All columns of the file.
    file : str
        Its name, for the message.
    taken : collection of str
        Inputs and output, which are not the time.
    structure : str
        The structure of the output (see `split_structures`). A time among its fields precedes one at the top;
        fields of other structures are ignored.

    Raises
    ------
    RecordError
        Several columns may be the time.
    """
    structures = split_structures(names)
    for home in dict.fromkeys((structure, "")):
        own = {
            name: name.removeprefix(home) for name in names if structures[name] == home and name not in taken
        }
        candidates = [
            name for name, word in own.items() if looks_like_time(word) and seconds_per_unit(word) is not None
        ]
        plain = [
            name for name in candidates if own[name].lower() in {"t", "time"} or parse_unit(own[name])
        ] or candidates
        if len(plain) > 1:
            raise RecordError(
                f"{file}: columns {' and '.join(plain)} may all be the time: rename all but one"
            )
        if plain:
            return plain[0]
    return None
