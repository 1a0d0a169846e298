"""Parts of a channel's name: the stem, the unit, and the mark of an input that acts at once."""

import re
from dataclasses import dataclass
from functools import lru_cache

#: Units by which a channel is recognised as a temperature.
TEMPERATURES = ("K", "degC", "C", "°C", "mK", "degF")

#: Suffix of an input's name: read the column one sample early, for a system that responds within the sample.
AT_ONCE = "+1"

#: Quantity and unit in the notation of ISO 80000: ``t/s``, ``U_1/mV``. Products of units are in brackets.
#: Instruments also write a quotient without them: ``q/mL/min``.
# A run of blanks must match in one way only: otherwise the time grows with the square of its length.
_QUOTIENT = re.compile(r"([^/]*[^/\s])\s*/\s*([^/\s]+(?:/[^/\s]+)?)")

#: Quantity, unit, and remarks of a logger in brackets: ``Temp, °C (LGR S/N: 10412233)``.
_LISTED = re.compile(r"([^,]*[^,\s]),\s*([^,\s\[(]+)(\s*[\[(].*[\])])?")

_BRACKETED = re.compile(r"(|.*\S)\s*[\[(（]([^\[\]()（）]*(?:\([^\[\]()（）]*\))?)[\])）]")

#: Exponents of ten of the SI prefixes.
_PREFIXES = {"": 0, "p": -12, "n": -9, "u": -6, "m": -3, "c": -2, "d": -1, "k": 3, "M": 6, "G": 9, "T": 12}

#: Units without a prefix, and symbols that may have one of `_PREFIXES`.
PLAIN_UNITS = tuple("% pct min h d deg ° °C degC °F degF rpm psi dB".split())  # noqa: SIM905
SYMBOLS = tuple("m g s A K mol cd Hz N Pa J W C V F ohm S Wb T H L l bar eV rad Ah Wh".split())  # noqa: SIM905

_UNIT = re.compile(f"(?:{'|'.join(PLAIN_UNITS)})|([{''.join(_PREFIXES)}]?)({'|'.join(SYMBOLS)})")

#: Units of long times, which are also words behind other names: ``y_min`` is the least y.
_LONG_TIMES = ("min", "h", "d")

#: Names of times.
_TIME_STEM = re.compile(r"(?:t|(?i:.*(?:time|zeit|duration|dauer|delay|period|age)))(?:_.*)?", re.DOTALL)

#: Units of time that divide the unit before them.
_DIVISORS = frozenset({"s", "s2", "min", "h"})

#: Units that divide the unit before them, by the quantity, with the letters of the quantity (ISO 80000):
#: ``heat_kJ_kg`` is in kJ/kg, and ``cart_m_kg`` is a mass m in kg.
_PER = {
    "time": (re.compile(r"[munp]?s2?|min|h|d"), "tTh"),
    "length": (re.compile(r"[munck]?m[23]?"), "Llhdsx"),
    "volume": (re.compile(r"[mcd]?[lL]"), "V"),
    "mass": (re.compile(r"[mk]?g"), "m"),
    "temperature": (re.compile(r"K|degC|°C"), "T"),
    "amount": (re.compile(r"m?mol"), "n"),
}

#: Two divisors without a mark between them, as in ``W_mK`` and ``J_kgK``.
_TWO_DIVISORS = re.compile(r"(kg|mol|m2?)(K)")

#: Force and length, which make a torque with and without a mark between them.
_FORCE, _LENGTH, _TORQUE = re.compile(r"[mkM]?N"), re.compile(r"[mc]?m"), re.compile(r"[mukM]?N[mc]?m")

#: Divisors and their dividend in a name, at most.
_MOST_FACTORS = 4

#: Quantities of one letter that are measured in a unit of time, although the letter is also a unit.
_TIMES = ("t", "T", "h")

#: Units in words, as instruments write them in a row of units.
_WORDS = {
    "second": "s",
    "seconds": "s",
    "sec": "s",
    "secs": "s",
    "millis": "ms",
    "millisecond": "ms",
    "milliseconds": "ms",
    "micros": "us",
    "microsecond": "us",
    "microseconds": "us",
    "nanos": "ns",
    "nanosecond": "ns",
    "nanoseconds": "ns",
    "mins": "min",
    "hr": "h",
    "hrs": "h",
    "msec": "ms",
    "usec": "us",
    "minute": "min",
    "minutes": "min",
    "hour": "h",
    "hours": "h",
    "day": "d",
    "days": "d",
    "sekunden": "s",
    "minuten": "min",
    "stunden": "h",
    "tage": "d",
    "tagen": "d",
    "secondes": "s",
    "segundos": "s",
    "secondi": "s",
    "seg": "s",
    "sek": "s",
    "с": "s",
    "сек": "s",
    "мс": "ms",
    "мкс": "us",
    "мин": "min",
    "ч": "h",
    "秒": "s",
    "毫秒": "ms",
    "分": "min",
    "volt": "V",
    "volts": "V",
    "ampere": "A",
    "amp": "A",
    "amps": "A",
    "watt": "W",
    "watts": "W",
    "hertz": "Hz",
}

#: Spellings of the same symbol.
_SPELLINGS = str.maketrans("²³⁻¹", "23-1") | str.maketrans(
    {"\N{MICRO SIGN}": "u", "μ": "u", "Ω": "ohm", "\N{OHM SIGN}": "ohm", "º": "°"}
)


@dataclass(frozen=True, slots=True)
class ChannelName:
    """A name in parts: ``u_mV+1`` has the base ``u_mV``, the stem ``u``, the unit ``mV``, and acts at once.

    The stem is the base without the unit, if the unit is known; otherwise it is the base.
    """

    base: str
    stem: str
    unit: str
    at_once: bool


# Every simulation compares the names of its model with those of its record.
@lru_cache(maxsize=256)
def parse_channel_name(name: str) -> ChannelName:
    """Return the parts of the name of an input or an output."""
    base = name.removesuffix(AT_ONCE)
    stem, unit = _split_unit(base)
    return ChannelName(base, stem or base, unit, base != name)


def parse_unit(name: str) -> str:
    """Return the unit in a column's name, empty if it has none: ``V`` for ``u_est_V``, ``u [V]`` and ``u/V``.

    The unit is the text in brackets, behind a slash, behind a comma (``Temp, °C``), after the last
    underscore, or, if it begins with a degree sign, behind a blank (``Soll °C``). A unit of time, length,
    mass, temperature or amount after another unit divides it: ``omega_rad_s`` is in ``rad/s``,
    ``solar_W_m2`` in ``W/m2``, ``c_J_kg_K`` in ``J/kg/K``. A length after a force makes a torque:
    ``torque_N_m``. Text that is not a unit is a part of the name:
    ``oven_temperature``, ``speed (measured)``, ``level_min``.
    """
    return _split_unit(name)[1]


def _split_unit(name: str) -> tuple[str, str]:
    """Return the name without its unit, and the unit."""
    if (bracketed := _BRACKETED.fullmatch(name)) and is_unit(unit := bracketed[2].strip()):
        return bracketed[1].rstrip(" /"), unit
    if (listed := _LISTED.fullmatch(name)) and is_unit(listed[2]):
        return listed[1] + (listed[3] or ""), listed[2]
    if (quotient := _match_quotient(name)) is not None:
        return quotient[1], quotient[2]
    words, _, degrees = name.rpartition(" ")
    if words.strip() and degrees.startswith("°") and is_unit(degrees):
        return words.rstrip(), degrees
    parts = name.split("_")
    for count in range(min(len(parts) - 1, _MOST_FACTORS), 1, -1):
        stem, unit = "_".join(parts[:-count]), _join_factors(parts[-count:])
        if stem and unit:
            return stem, unit
    stem, _, last = name.rpartition("_")
    if not (stem and is_unit(last)):
        return name, ""
    return (name, "") if last in _LONG_TIMES and not _TIME_STEM.fullmatch(stem) else (stem, last)


def _join_factors(factors: list[str]) -> str:
    """Return the unit that the last words of a name make, empty if they make none."""
    first, *others = factors
    if "per" in others:
        above, below = factors[: factors.index("per")], factors[factors.index("per") + 1 :]
        is_quotient = len(above) == len(below) == 1 and is_unit(below[0]) and (first == "1" or is_unit(first))
        return f"{first}/{below[0]}" if is_quotient else ""
    if len(others) == 1 and _FORCE.fullmatch(first) and _LENGTH.fullmatch(others[0]):
        return f"{first} {others[0]}"
    divisors: list[str] = []
    for each in others:
        two = _TWO_DIVISORS.fullmatch(normalise_unit(each))
        divisors += two.groups() if two else [each]
    # Nothing is measured in a time per another unit.
    is_dividend = first == "1" or (is_unit(first) and not _PER["time"][0].fullmatch(first))
    if not is_dividend or any(_is_symbol(first, each) is not False for each in divisors):
        return ""
    return "/".join([first, *divisors])


def _is_symbol(letter: str, unit: str) -> bool | None:
    """Return whether a letter is that of the quantity of a divisor; None for a unit that divides no other."""
    return next(
        (letter in letters for units, letters in _PER.values() if units.fullmatch(normalise_unit(unit))), None
    )


def _match_quotient(name: str) -> re.Match[str] | None:
    """Match a quantity divided by its unit; ``v_m/s``, ``km/h`` and ``l/min`` are quotients of two units."""
    quotient = _QUOTIENT.fullmatch(name)
    if quotient is None or not is_unit(quotient[2]):
        return None
    last = quotient[1].rpartition("_")[2]
    is_rate = quotient[2] in _DIVISORS and last not in _TIMES
    return None if is_unit(last) and ("_" in quotient[1] or len(last) > 1 or is_rate) else quotient


def is_unit(text: str) -> bool:
    """Return whether a text is a unit, or a product or quotient of units, such as ``m/s2``."""
    factors = re.split(r"[/.*·( ]+", normalise_unit(text).removeprefix("1/").removesuffix(")"))
    units = [re.sub(r"\^?-?[0-9]$", "", factor) for factor in factors]
    return all(_UNIT.fullmatch(unit) or _TORQUE.fullmatch(unit) for unit in units)


def normalise_unit(text: str) -> str:
    """Return a unit in one spelling: ``um`` for ``µm``, ``kohm`` for ``kOhm``, ``C`` for ``°C``, ``oC``."""
    spelled = text.translate(_SPELLINGS).replace("Ohm", "ohm")
    return re.sub(r"(?:°|deg|\bo)(?=[CF])", "", spelled)


def describe_contradiction(name: str, unit: str) -> str:
    """State that the unit of a column is not that of its name; empty if they agree or one is unknown."""
    named = parse_channel_name(name).unit
    if not (named and unit and is_unit(unit)) or normalise_unit(named) == normalise_unit(unit):
        return ""
    return f"{name} is named in {named}, but its unit is {unit}: rename the column or convert it"


def spell_unit(text: str) -> str:
    """Return the symbol of a unit that is written as a word (``Volt``), else the text itself."""
    return _WORDS.get(text.lower(), text)


def simplify_unit(text: str) -> str:
    """Return a quotient of units without the factor 1: ``V`` for ``V/1^3``, empty for ``1/1``."""
    numerator, *denominators = (
        " ".join(factor for factor in part.split(" ") if not re.fullmatch(r"1(\^\d+)?", factor))
        for part in text.split("/")
    )
    kept = [part for part in denominators if part]
    return "/".join([numerator or ("1" if kept else ""), *kept])


def conversion_factor(unit: str, other: str) -> float | None:
    """Return the factor from a unit to the same unit with another prefix, None for two other units."""
    one, two = (_UNIT.fullmatch(normalise_unit(text)) for text in (unit, other))
    if one is None or two is None or one[2] is None or one[2] != two[2]:
        return None
    return float(f"1e{_PREFIXES[one[1]] - _PREFIXES[two[1]]}")
