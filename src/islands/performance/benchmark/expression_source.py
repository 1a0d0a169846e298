"""Expressions as the yardsticks read them: the infix text of exported programs, with a sign alone."""

from collections.abc import Callable

from islands.errors import ModelError
from islands.io.export.infix import infix as exported
from islands.model.expression import Expression, Primitive
from islands.model.primitives import SIGN


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
    return exported(expression, signal, _sign)


def _sign(primitive: Primitive) -> str:
    if primitive != SIGN:
        raise ModelError(
            f"the benchmark measures products, sums, differences and signs, got {primitive.name!r}"
        )
    return primitive.name
