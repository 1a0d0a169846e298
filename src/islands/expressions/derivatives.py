"""Derivatives of expressions along a direction in the space of the signals."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

from islands.expressions.primitives import LARGEST_EXPONENT
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Primitive, Shift

_Partials = tuple[float, ...]


def _differentiate_div(a: float, b: float) -> _Partials:
    return (1.0 / b, -(a / b) / b) if b else (math.nan, math.nan)


def _differentiate_sqrt(a: float) -> _Partials:
    return (math.copysign(0.5, a) / math.sqrt(abs(a)) if a else math.nan,)


def _differentiate_exp(a: float) -> _Partials:
    if a == LARGEST_EXPONENT:
        return (math.nan,)
    return (math.exp(a) if a < LARGEST_EXPONENT else 0.0,)


def _choose(first: bool, second: bool) -> _Partials:
    return (float(first), float(second)) if first != second else (math.nan, math.nan)


#: Partial derivatives of the primitives of the canonical form, NaN where a primitive has a kink or a step.
_PARTIALS: Mapping[str, Callable[..., _Partials]] = MappingProxyType(
    {
        "mul": lambda a, b: (b, a),
        "add": lambda *_: (1.0, 1.0),
        "sub": lambda *_: (1.0, -1.0),
        "div": _differentiate_div,
        "sign": lambda a: (0.0 if a else math.nan,),
        "abs": lambda a: (math.copysign(1.0, a) if a else math.nan,),
        "sqrt": _differentiate_sqrt,
        "exp": _differentiate_exp,
        "log": lambda a: (1.0 / a if a else math.nan,),
        "sin": lambda a: (math.cos(a),),
        "cos": lambda a: (-math.sin(a),),
        "tanh": lambda a: (1.0 - math.tanh(a) ** 2,),
        "max": lambda a, b: _choose(a > b, a < b),
        "min": lambda a, b: _choose(a < b, a > b),
    }
)

#: First step of the differences of a user-defined primitive, relative to the argument.
_STEP = 0.05

#: Number of steps, each half of the one before.
_STEPS = 8


def differentiate(
    expression: Expression, signal: Callable[[int], float], rate: Callable[[int], float]
) -> tuple[float, float]:
    """Return the value of an expression at constant signals, and its derivative along a direction.

    The chain rule is applied to exact partial derivatives of the built-in primitives, and to extrapolated
    differences of user-defined ones.

    Parameters
    ----------
    expression : Expression
    signal : callable
        ``signal(channel)`` is the constant value of a channel.
    rate : callable
        ``rate(channel)`` is the derivative of that value along the direction.

    Returns
    -------
    value, derivative : float
        The derivative is NaN at a kink or a step, such as that of ``abs(u)`` at 0.
    """
    match expression:
        case Lagged(channel, _):
            return signal(channel), rate(channel)
        case Constant(number):
            return number, 0.0
        case Shift(_, argument):
            return differentiate(argument, signal, rate)
        case Apply(primitive, arguments):
            parts = [differentiate(argument, signal, rate) for argument in arguments]
    if len(parts) == 1:
        return _call(primitive, parts)
    total = parts[0]
    for other in parts[1:]:
        total = _call(primitive, [total, other])
    return total


def _call(primitive: Primitive, parts: list[tuple[float, float]]) -> tuple[float, float]:
    values = [number for number, _ in parts]
    slope = 0.0
    if any(rate for _, rate in parts):
        exact = _PARTIALS.get(primitive.name)
        partials = exact(*values) if exact else _extrapolate(primitive, values)
        # A constant argument contributes nothing, also at a kink.
        slope = sum(partial * rate for partial, (_, rate) in zip(partials, parts, strict=True) if rate)
    return primitive.scalar(*values), slope


def _extrapolate(primitive: Primitive, values: list[float]) -> _Partials:
    """Return the partial derivatives by Richardson extrapolation of central differences."""
    partials = []
    for position, centre in enumerate(values):

        def evaluate(at: float, position: int = position) -> float:
            return primitive.scalar(*(at if i == position else each for i, each in enumerate(values)))

        step = _STEP * max(1.0, abs(centre))
        row: list[float] = []
        best, error = math.nan, math.inf
        for _ in range(_STEPS):
            previous, row = row, [(evaluate(centre + step) - evaluate(centre - step)) / (2.0 * step)]
            for order, coarse in enumerate(previous, start=1):
                row.append(row[-1] + (row[-1] - coarse) / (4.0**order - 1.0))
                spread = max(abs(row[-1] - row[-2]), abs(row[-1] - coarse))
                if spread < error:
                    best, error = row[-1], spread
            step /= 2.0
        partials.append(best)
    return tuple(partials)
