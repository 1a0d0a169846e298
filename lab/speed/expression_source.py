"""Infix source of expressions for the baselines; the only function in it is the sign."""

from collections.abc import Callable

from islands.errors import ModelError
from islands.expressions.primitives import SIGN
from islands.expressions.printing import program_text
from islands.expressions.tree import Expression, Primitive


def infix(expression: Expression, signal: Callable[[int, int], str]) -> str:
    """Return the source of an expression; the code that uses it defines ``sign``.

    Parameters
    ----------
    expression : Expression
        Expression in canonical form, in which phi1 and phi2 are differences and signs.
    signal : callable
        ``signal(channel, lag)`` returns the source of a sample.

    Raises
    ------
    ModelError
        If it contains a function other than products, sums, differences and signs.
    """
    return program_text(expression, signal, _get_sign_name)


def _get_sign_name(primitive: Primitive) -> str:
    if primitive != SIGN:
        raise ModelError(
            f"the benchmark measures products, sums, differences and signs, got {primitive.name!r}"
        )
    return primitive.name
