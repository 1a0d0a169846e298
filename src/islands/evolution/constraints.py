"""The table of structural constraints: what a gene must look like, and how one that does not is mended."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from islands.model.expression import Apply, Expression, Lagged, Shift

Structure = Callable[[Expression], Expression]

#: Functions whose arguments are lags of one input (the paper, sections 3 and 5.2).
PHI = ("phi1", "phi2")

#: y(k-1): at rest it is y, so its parameter can hold the sum of its cluster at one.
LINEAR_OUTPUT = Lagged(0, 1)


def free(expression: Expression) -> Expression:
    """Leave a gene as it is."""
    return expression


def phi(expression: Expression) -> Expression:
    """Mend phi functions (Figure 3): an argument that is no lagged input becomes u(k-1).

    Both arguments are lags of the same input, that of the first one; a lag of another input in the second
    place becomes u(k-1) of that input too.
    """
    match expression:
        case Apply(primitive, (first, second)) if primitive.name in PHI:
            one = first if is_lagged_input(first) else Lagged(max(1, _input_of(second)))
            other = second if _input_of(second) == _input_of(one) else Lagged(_input_of(one))
            return Apply(primitive, (one, other))
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(phi(argument) for argument in arguments))
        case Shift(samples, argument):
            return Shift(samples, phi(argument))
        case _:
            return expression


def increment(expression: Expression) -> Expression:
    """Mend phi functions, and let y(k-1) be the only linear output.

    With y(k-4) in its place the parameters' sum is met as well, but four interleaved solutions run beside
    each other: the error between them is never damped, and a free run falls apart.
    """
    return LINEAR_OUTPUT if is_linear_output(expression) else phi(expression)


def is_linear_output(expression: Expression) -> bool:
    """Tell whether an expression is the output under back-shifts alone."""
    while isinstance(expression, Shift):
        expression = expression.argument
    return isinstance(expression, Lagged) and expression.channel == 0


def is_lagged_input(expression: Expression) -> bool:
    """Tell whether an expression is an input under back-shifts alone."""
    return _input_of(expression) > 0


def _input_of(expression: Expression) -> int:
    """Return the input that an expression is a lag of, 0 where it is anything else."""
    while isinstance(expression, Shift):
        expression = expression.argument
    return expression.channel if isinstance(expression, Lagged) else 0


STRUCTURES: Mapping[str, Structure] = MappingProxyType({"free": free, "phi": phi, "increment": increment})
