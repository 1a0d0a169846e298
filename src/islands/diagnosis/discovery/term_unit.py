"""Units of expressions, as products of powers of the units of their symbols."""

import re
from collections.abc import Mapping
from fractions import Fraction

from islands.expressions.tree import FMU, Apply, Constant, Expression, Primitive, Symbol

#: Powers by the symbol of a unit.
Powers = dict[str, Fraction]

#: A factor of a unit: its symbol and its power, as in ``s^2``, ``s2`` and ``s``.
_FACTOR = re.compile(r"([^\d\s^()]+)(?:\^?(-?\d+))?")

#: Functions whose result has the unit of their operands.
_SAME = frozenset({"add", "sub", "neg", "abs", "min", "max"})

#: Functions whose result has no unit.
_DIMENSIONLESS = frozenset({"sign", "less", "less_equal", "tanh", "atan", "exp", "log", "sin", "cos", "tan"})


def find_factor_unit(unit: str, expression: Expression, units: Mapping[str, str]) -> str:
    """Return the unit of a factor whose product with an expression has a given unit.

    Parameters
    ----------
    unit : str
        Unit of the product.
    expression : expression
    units : mapping
        Units of the symbols.

    Returns
    -------
    str
        Empty if the factor has no unit, or if the units are not known.
    """
    return _render_quotient(_parse_powers(unit), _find_powers(expression, units))


def find_expression_unit(expression: Expression, units: Mapping[str, str]) -> str:
    """Return the unit of an expression; empty if it has none, or if the units are not known."""
    return _render_quotient(_find_powers(expression, units), {})


def divide_units(unit: str, other: str) -> str:
    """Return the quotient of two units; empty if one of them is not known."""
    return _render_quotient(_parse_powers(unit), _parse_powers(other))


def _parse_powers(unit: str) -> Powers | None:
    """Return the powers of a unit such as ``N s/m`` or ``m/s^2``; None if it is empty or not understood."""
    powers: Powers = {}
    for index, part in enumerate(unit.split("/")):
        for factor in re.split(r"[ *·.]", part):
            if factor == "1":
                continue
            found = _FACTOR.fullmatch(factor)
            if found is None:
                return None
            powers = _combine(powers, {found[1]: Fraction(found[2] or 1)}, -1 if index else 1)
    return powers


def _render_quotient(numerator: Powers | None, denominator: Powers | None) -> str:
    if numerator is None or denominator is None:
        return ""
    powers = _combine(numerator, denominator, -1)
    above = " ".join(_render_factor(name, power) for name, power in powers.items() if power > 0)
    below = "".join(f"/{_render_factor(name, -power)}" for name, power in powers.items() if power < 0)
    return f"{above or '1'}{below}" if above or below else ""


def _render_factor(name: str, power: Fraction) -> str:
    return name if power == 1 else f"{name}^{float(power):g}"


def _combine(powers: Powers, others: Powers, sign: int | Fraction) -> Powers:
    """Return the powers of a product with a power of another unit."""
    names = dict.fromkeys([*powers, *others])
    combined = {name: powers.get(name, Fraction()) + sign * others.get(name, Fraction()) for name in names}
    return {name: power for name, power in combined.items() if power}


def _find_powers(expression: Expression, units: Mapping[str, str]) -> Powers | None:
    """Return the powers of the unit of an expression; None if it is not known."""
    match expression:
        case Constant():
            return {}
        case Symbol(name):
            return _parse_powers(units.get(name, ""))
        case Apply(function, _) if function.name in _DIMENSIONLESS:
            return {}
        case Apply(Primitive("pow"), (base, Constant(power))):
            return _scale(_find_powers(base, units), Fraction(power))
        case Apply(Primitive("sqrt"), (base,)):
            return _scale(_find_powers(base, units), Fraction(1, 2))
        case Apply(Primitive("rate"), (signal,)):
            powers = _find_powers(signal, units)
            return None if powers is None else _combine(powers, {"s": Fraction(1)}, -1)
        case Apply(function, (operand,)) if function == FMU:
            return _find_powers(operand, units)
        case Apply(Primitive("mul" | "div" as name), (first, second)):
            one, other = _find_powers(first, units), _find_powers(second, units)
            if one is None or other is None:
                return None
            return _combine(one, other, 1 if name == "mul" else -1)
        case Apply(function, operands) if function.name in _SAME:
            # A number is a limit or an offset in the unit of the others.
            found = [_find_powers(each, units) for each in operands if not isinstance(each, Constant)]
            return found[0] if found and all(each == found[0] for each in found) else None
    return None


def _scale(powers: Powers | None, factor: Fraction) -> Powers | None:
    return None if powers is None else {name: factor * power for name, power in powers.items()}
