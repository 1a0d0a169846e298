"""Text of constraints: statements that are separated by semicolons."""

import re
from collections.abc import Callable, Mapping
from math import isfinite

from islands.errors import ModelError, SettingsError, suggest
from islands.estimation.constraints.parts import (
    FixedPoint,
    LinearEquality,
    ParameterSign,
    Part,
    StaticGain,
)
from islands.expressions.parsing import parse
from islands.models.regressor import Regressor, regressor

#: Largest number of statements; the cost of an estimation grows with it.
MOST_STATEMENTS = 50

#: Forms of a statement that is not a name.
FORMS = (
    "fixed-point = U, Y",
    "gain = G",
    "gain(u2) = G at U1, U2, Y",
    "[u(k-1)] + 2*[u(k-2)] = 1",
    "[u(k-1)] >= 0",
)

# A run of digits or of white space must match in one way only: otherwise the time grows exponentially.
_UNSIGNED = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER = rf"[-+]?{_UNSIGNED}"
_NUMBERS = rf"{_NUMBER}(?:\s*,\s*{_NUMBER})*"
_TERM = re.compile(rf"\s*(?:(?P<sign>[-+])\s*)?(?:(?P<weight>{_UNSIGNED})\s*\*\s*)?\[(?P<term>[^\[\]]+)\]")
_FIXED_POINT = re.compile(rf"fixed-point\s*=\s*(?P<point>{_NUMBERS})")
_GAIN = re.compile(
    rf"gain(?:\(u(?P<channel>\d{{1,3}})?\))?\s*=\s*(?P<gain>{_NUMBER})(?:\s*at\s+(?P<point>{_NUMBERS}))?"
)
_TERMS = rf"(?:{re.sub(r'P<[a-z]+>', ':', _TERM.pattern)})+"
_LINEAR = re.compile(rf"(?P<terms>{_TERMS})\s*(?P<relation><=|>=|=)\s*(?P<target>{_NUMBER})")


def parse_statements(text: str, names: Mapping[str, tuple[Part, ...]]) -> tuple[Part, ...]:
    """Parse statements that are separated by semicolons.

    Parameters
    ----------
    text : str
        For example ``odd; gain = 2.5; [u(k-1)] - [u(k-2)] = 0``.
    names : mapping
        Parts of the statements that are a name.

    Raises
    ------
    SettingsError
        A statement cannot be read, or there are more than `MOST_STATEMENTS`.
    """
    statements = [" ".join(statement.split()) for statement in text.split(";")]
    if len(statements) > MOST_STATEMENTS:
        raise SettingsError(f"{len(statements)} constraints are too many: state at most {MOST_STATEMENTS}")
    parts: list[Part] = []
    for statement in statements:
        parts += names[statement] if statement in names else (_parse_statement(statement, names),)
    return tuple(parts)


def _parse_statement(statement: str, names: Mapping[str, tuple[Part, ...]]) -> Part:
    forms: tuple[tuple[re.Pattern[str], Callable[[str, re.Match[str]], Part]], ...] = (
        (_FIXED_POINT, _make_fixed_point),
        (_GAIN, _make_gain),
        (_LINEAR, _make_linear),
    )
    for pattern, make in forms:
        if match := pattern.fullmatch(statement):
            return make(statement, match)
    raise SettingsError(
        f"unknown constraints {statement[:80]!r}: take one of {', '.join(names)}, or a statement such as "
        f"{'; '.join(FORMS)}{suggest(statement, names)}"
    )


def _make_fixed_point(statement: str, match: re.Match[str]) -> Part:
    return FixedPoint(statement, _read_point(statement, match["point"]))


def _make_gain(statement: str, match: re.Match[str]) -> Part:
    point = _read_point(statement, match["point"]) if match["point"] else ()
    channel = int(match["channel"] or 1)
    if channel < 1 or (point and channel >= len(point)):
        raise SettingsError(f"{statement!r} names an input without a value: inputs are u1, u2, ...")
    return StaticGain(statement, _read_number(statement, match["gain"]), channel, point)


def _read_point(statement: str, text: str) -> tuple[float, ...]:
    """Return the output, which the text gives last, and the inputs."""
    *inputs, output = (_read_number(statement, number) for number in text.split(","))
    if not inputs:
        raise SettingsError(f"{statement!r} has one number: give a value of every input, then of the output")
    return (output, *inputs)


def _read_number(statement: str, text: str) -> float:
    number = float(text)
    if not isfinite(number):
        raise SettingsError(f"{statement!r} contains a number that is too large")
    return number


def _make_linear(statement: str, match: re.Match[str]) -> Part:
    weights: dict[Regressor, float] = {}
    for position, text in enumerate(match["terms"].split("]")[:-1]):
        entry = _TERM.fullmatch(f"{text}]")
        assert entry is not None
        if position and not entry["sign"]:
            raise SettingsError(f"{statement!r} lacks a sign before [{entry['term']}]: write + or -")
        weight = _read_number(statement, f"{entry['sign'] or ''}{entry['weight'] or 1}")
        factor, item = _read_term(statement, entry["term"])
        # The parameter of 2*u(k-1) is half of that of u(k-1), which the model has.
        weights[item] = weights.get(item, 0.0) + weight / factor
    target = _read_number(statement, match["target"])
    if not any(weights.values()):
        raise SettingsError(f"the terms of {statement!r} cancel")
    if match["relation"] == "=":
        return LinearEquality(statement, weights, target)
    if len(weights) > 1 or target:
        raise SettingsError(f"{statement!r} is not the sign of one parameter: write [u(k-1)] >= 0")
    (item, weight), above = next(iter(weights.items())), match["relation"] == ">="
    return ParameterSign(statement, item, 1 if (weight > 0.0) == above else -1)


def _read_term(statement: str, text: str) -> tuple[float, Regressor]:
    try:
        factor, item = regressor(parse(text))
    except (ModelError, RecursionError) as error:
        raise SettingsError(f"cannot read the constraint {statement[:80]!r}: {error}") from error
    if item is None:
        raise SettingsError(f"[{text}] in {statement[:80]!r} is identically zero")
    return factor, item
