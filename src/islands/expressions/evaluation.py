"""Values of expressions, computed with Python or NumPy."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from islands.errors import ModelError
from islands.expressions.printing import render
from islands.expressions.tree import (
    FMU,
    SIGNAL_FUNCTIONS,
    Apply,
    Constant,
    Expression,
    Lagged,
    Shift,
    Symbol,
    remove_shifts,
)

#: No parameters.
_NONE: Mapping[str, float] = MappingProxyType({})


def value(
    expression: Expression, signal: Callable[[int, int], float], parameters: Mapping[str, float] = _NONE
) -> float:
    """Evaluate an expression of lagged signals. This is the reference implementation for the kernels.

    Parameters
    ----------
    expression : Expression
    signal : callable
        ``signal(channel, lag)`` returns the value of the channel ``lag`` samples back.
    parameters : mapping
        Values of the parameters by name. They and the signals are arrays only in sums, differences and
        products.

    Raises
    ------
    ModelError
        The expression contains an unknown name or an unknown kind of node.
    """

    def read(leaf: Expression) -> float:
        if isinstance(leaf, Lagged):
            return signal(leaf.channel, leaf.lag)
        if isinstance(leaf, Symbol) and leaf.name in parameters:
            return parameters[leaf.name]
        raise ModelError(f"{leaf!r} is not an expression: use Lagged, Constant, Shift or Apply")

    found: float = _evaluate(expression, read)
    return found


def evaluate(expression: Expression, values: Mapping[str, Any]) -> Any:
    """Evaluate an expression of names with NumPy.

    Parameters
    ----------
    expression : Expression
    values : mapping
        Values of the names, numbers or arrays of equal shape; the values of ``rate(F)``, ``delay(F, tau)``
        and ``fmu(y)`` by their text.

    Returns
    -------
    float or ndarray
    """
    with np.errstate(all="ignore"):
        return _evaluate(expression, lambda leaf: values[render(leaf)])


def _evaluate(expression: Expression, read: Callable[[Expression], Any]) -> Any:
    """Evaluate an expression; ``read`` returns the value of a leaf, and of a function of a whole signal."""
    match expression:
        case Constant(number):
            return number
        case Shift():
            return _evaluate(remove_shifts(expression), read)
        case Apply(primitive, arguments) if primitive not in (*SIGNAL_FUNCTIONS, FMU):
            first, *others = (_evaluate(argument, read) for argument in arguments)
            if len(others) < primitive.arity:
                return primitive.scalar(first, *others)
            for other in others:
                first = primitive.scalar(first, other)
            return first
    return read(expression)
