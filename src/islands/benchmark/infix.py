"""Expressions as infix text that Python and C read alike: what the yardsticks are compiled from."""

from collections.abc import Callable

from islands.errors import ModelError
from islands.model.expression import Apply, Constant, Expression, Lagged

_OPERATORS = {"mul": "*", "add": "+", "sub": "-"}


def infix(expression: Expression, signal: Callable[[int, int], str]) -> str:
    """Write an expression with a ``sign`` that the reader defines.

    Parameters
    ----------
    expression : Expression
        In canonical form, so that phi1 and phi2 are differences and their signs.
    signal : callable
        ``signal(channel, lag)`` writes a sample.

    Raises
    ------
    ModelError
        It has a function other than products, sums, differences and signs.
    """
    match expression:
        case Lagged(channel, lag):
            return signal(channel, lag)
        case Constant(number):
            return f"({number!r})"
        case Apply(primitive, arguments) if primitive.name in _OPERATORS:
            # Operators of one kind are carried out from the left in both languages, as in `value`.
            return "(" + _OPERATORS[primitive.name].join(infix(part, signal) for part in arguments) + ")"
        case Apply(primitive, (argument,)) if primitive.name == "sign":
            return f"sign({infix(argument, signal)})"
    raise ModelError(f"the benchmark measures products, sums, differences and signs, got {expression!r}")
