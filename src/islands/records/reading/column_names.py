"""Column names: units, structures and the time column."""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from numbers import Integral
from reprlib import repr as abbreviate
from types import MappingProxyType

from islands.errors import RecordError, SettingsError, join_text, name_option
from islands.records.channel_names import (
    AT_ONCE,
    is_unit,
    normalise_unit,
    parse_channel_name,
    parse_unit,
    spell_unit,
)

#: Units of time columns in seconds. A column without a unit is in seconds.
TIME_UNITS = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86_400.0}

#: Units with which a capital T means a temperature.
TEMPERATURE_UNITS = ("K", "C", "degC", "°C", "F", "degF", "°F")

_TIME = re.compile(
    r"t(_.*|\s*[\[(（/].*)?|(?:time|zeit|elapsed|date|datum|uhrzeit|x-axis).*|x_value|sec(?:ond)?s?",
    re.IGNORECASE,
)

#: Words for time in other languages, which no letter follows in an alphabet.
_FOREIGN_TIME = re.compile(
    r"(?:(?:время|часы?|tiempo|hora|heure|tijd|czas|čas|idő|aika|zaman)(?![^\W\d_])|"
    r"时间|時間|时刻|時刻|시간).*",
    re.IGNORECASE,
)

#: Words for time that have another meaning in English: they need a unit of time.
_AMBIGUOUS_TIME = re.compile(r"(?:temps|tempo|tid)\s*[\[(（/,].*", re.IGNORECASE)

#: Time since the start of a test or a program, which battery cyclers and test benches write next to the time
#: of a step; it needs a unit of time, and comes after other columns of time.
_RUN_TIME = re.compile(
    r"(?:test|total|run(?:ning)?|measure(?:ment)?|meas|rec(?:ord(?:ing)?)?|exp(?:eriment)?|abs(?:olute)?|"
    r"prüf|mess|lauf|versuchs|gesamt)[ _-]?(?:time|zeit).*",
    re.IGNORECASE,
)

#: Unit at the end of a name in camel case.
_CAPITAL_UNIT = re.compile(r"(?<=[a-z])(?:[MUN]s|[A-Z][a-z]{2,12})$")

#: Marks before the last word of a name, and marks before which no last word begins.
_OPENING, _CLOSING = "_[(（/", "])）"

#: Last words of names of time columns that are not a unit.
_WORDS = ("time", "value", "stamp", "utc", "gmt", "local", "unix", "posix", "epoch", "excel", "serial")


#: Names that a message lists, at most.
_LISTED = 10

#: Unit in brackets behind a name.
_BRACKETED_UNIT = re.compile(r"\s*[\[(（][^\[\]()（）]*[\])）]")


def split_structures(names: Iterable[str]) -> dict[str, str]:
    """Return the structure that contains each column: ``run_1.`` for ``run_1.u_V``, ``""`` at the top level.

    A structure has at least two fields; a single point may be part of a unit (``k_N.m``).
    """
    prefixes = {name: name[: name.rfind(".") + 1] for name in names}
    fields = Counter(prefixes.values())
    return {name: prefix if fields[prefix] > 1 else "" for name, prefix in prefixes.items()}


def find_column(name: str, columns: Iterable[str]) -> str:
    """Return the column of a name: ``u_V`` for ``u_V+1``; ``u [V]`` or ``u/V`` for ``u`` if only one fits.

    A column with exactly the given name takes precedence.
    """
    columns = tuple(columns)
    base = name.removesuffix(AT_ONCE)
    if name in columns or base in columns:
        return name if name in columns else base
    fitting = [
        column
        for column in columns
        if column.startswith(base)
        and (
            _BRACKETED_UNIT.fullmatch(column, len(base))
            or (column[len(base) :].lstrip().startswith("/") and parse_channel_name(column).stem == base)
        )
    ]
    return fitting[0] if len(fitting) == 1 else base


def list_inputs(inputs: object) -> tuple[str, ...]:
    """Return the names of inputs that are given as one name or as a sequence; integers become texts.

    Raises
    ------
    SettingsError
        A set has no order, or an element is no name.
    """
    if inputs is None:
        return ()
    if isinstance(inputs, AbstractSet):
        raise SettingsError(f"inputs have an order, got a {type(inputs).__name__}: give a list")
    if isinstance(inputs, str) or not isinstance(inputs, Iterable):
        return (_check_name(inputs, "inputs"),)
    return tuple(_check_name(name, "inputs") for name in inputs)


def _check_name(name: object, argument: str) -> str:
    """Return a name of a column, which is a text or an integer, as a text."""
    if isinstance(name, str | Integral) and not isinstance(name, bool):
        return str(name)
    raise SettingsError(
        f"{argument} names columns, got {abbreviate(name)}, a {type(name).__name__}: give names such as "
        "'u_V', or all data as arrays, (u, y, dt)"
    )


def take_outputs(output: object) -> tuple[str, ...]:
    """Return the names of the outputs; an integer becomes a text.

    Raises
    ------
    SettingsError
        Something is given that is no name, or an empty list.
    """
    if output is None:
        return ()
    if isinstance(output, str) or not isinstance(output, Iterable):
        return (_check_name(output, "output"),)
    names = tuple(_check_name(name, "output") for name in output)
    if not names:
        raise SettingsError("output names at least one column, got none")
    return names


def number_column(place: int) -> str:
    """Return the name of a column of a file without a header."""
    return f"c{place + 1}"


def append_unit(name: str, unit: str) -> str:
    """Return a name with its unit in brackets, unless the name has one or the text is not a unit."""
    unit = spell_unit(unit.strip())
    return f"{name} [{unit}]" if unit and is_unit(unit) and not parse_unit(name) else name


def looks_like_time(name: str) -> bool:
    """Return whether a column's name is ``t``, ``t_*``, ``t/*`` or begins with a word such as ``time``.

    ``x-axis*``, ``X_Value`` and ``second`` are the names that oscilloscopes and LabVIEW write. ``T_K`` is a
    temperature. Words of other languages count as well: ``Время``, ``时间``; those with another meaning in
    English count with a unit of time, ``Temps (s)``, as does the time of a test, ``Test_Time(s)``.
    """
    if _TIME.fullmatch(name):
        return not (name[0] == "T" and parse_unit(name) in TEMPERATURE_UNITS)
    if _AMBIGUOUS_TIME.fullmatch(name) or _RUN_TIME.fullmatch(name):
        return _unit_word(name) in TIME_UNITS and _unit_word(name) != ""
    return bool(_FOREIGN_TIME.fullmatch(name))


def seconds_per_unit(name: str) -> float | None:
    """Return the unit of a time column in seconds, None if the unit is unknown."""
    return TIME_UNITS.get(_unit_word(name))


def has_unit_of_time(name: str) -> bool:
    """Return whether a name ends in a unit of time in brackets, whatever its words are: ``Source [s]``."""
    return name.endswith(tuple(_CLOSING)) and parse_unit(name) in set(TIME_UNITS) - {""}


def states_unit(name: str) -> bool:
    """Return whether a name ends in a unit of time, as a symbol or in words: ``t_ms``, ``Time (days)``.

    ``y_min`` is the least y, so that short symbols count behind the name of a time only.
    """
    unit = _unit_word(name)
    is_word = spell_unit(_last_word(name).lower()) != _last_word(name).lower()
    return unit != "" and unit in TIME_UNITS and (is_word or bool(parse_unit(name)) or looks_like_time(name))


def _unit_word(name: str) -> str:
    """Return the last word of a name as a symbol, empty if it is not meant as a unit."""
    text = normalise_unit(spell_unit(_last_word(name).lower()))
    return "" if text.isdigit() or text in _WORDS else text


def _last_word(name: str) -> str:
    """Return the end of a name in brackets, behind a mark or behind ``in``; empty if there is none.

    A unit of time may also follow a blank (``Elapsed hours``), or begin with a capital (``timeMs``).
    """
    text = name.strip()
    text = text[:-1] if text.endswith(tuple(_CLOSING)) else text
    place = max(text.rfind(mark) for mark in _OPENING + _CLOSING)
    if place >= 0 and text[place] in _OPENING:
        return text[place + 1 :].strip()
    rest = text[place + 1 :]
    _, *word = re.split(r"\sin\s", rest, maxsplit=1)
    if word:
        return word[0].strip()
    last = rest.split()[-1] if len(rest.split()) > 1 else ""
    if not last and (capital := _CAPITAL_UNIT.search(rest)):
        last = capital[0]
    return last if normalise_unit(spell_unit(last.lower())) in TIME_UNITS else ""


def time_column(
    names: Collection[str],
    file: str,
    taken: Collection[str] = (),
    structure: str = "",
    clocks: Mapping[str, str] = MappingProxyType({}),
) -> str | None:
    """Return the name of the time column, None if the file has no time column.

    ``t``, ``time`` and names with a unit of time take precedence over other words that begin with ``time``,
    so that a file may contain both ``timestamp`` and ``t_s``. The time of a test follows, and columns of time
    stamps come last, because other columns are more precise.

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
    clocks : mapping of str to str
        Columns of time stamps, with the columns of their dates.

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
            if name not in {*clocks, *clocks.values()}
            and looks_like_time(field)
            and seconds_per_unit(field) is not None
        ]
        candidates = [name for name in candidates if not _RUN_TIME.fullmatch(fields[name])] or candidates
        preferred = [
            name for name in candidates if fields[name].lower() in {"t", "time"} or parse_unit(fields[name])
        ] or candidates
        if found := _check_single(preferred, file):
            return found
    stamps = [name for name in clocks if name not in taken]
    return _check_single([name for name in stamps if looks_like_time(name)] or stamps, file)


def _check_single(candidates: Sequence[str], file: str) -> str | None:
    if len(candidates) > 1:
        listed = " and ".join(candidates[:_LISTED])
        raise RecordError(
            join_text(f"{file}: columns {listed} may all be the time: name one by ", name_option("time"))
        )
    return candidates[0] if candidates else None
