"""The table of structural constraints: what a gene must look like, and how one that does not is mended."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from islands.model.expression import Apply, Expression, Lagged, Shift
from islands.model.primitives import PRIMITIVES, SIGN, SUB

Structure = Callable[[Expression], Expression]

#: Functions whose arguments are lags of one input (the paper, sections 3 and 5.2).
PHI = ("phi1", "phi2")

#: y(k-1): at rest it is y, so its parameter can hold the sum of its cluster at one.
LINEAR_OUTPUT = Lagged(0, 1)


def free(expression: Expression) -> Expression:
    """Leave a gene as it is."""
    return expression


def phi(expression: Expression) -> Expression:
    """Mend phi functions (Figure 3): what is no input under an argument's back-shifts becomes u(k-1).

    The back-shifts stay: ``phi1(q1(y(k-1)), q4(u(k-1)*y(k-1)))`` becomes ``phi1(q1(u(k-1)), q4(u(k-1)))``, as
    in the figure. Both arguments are lags of the same input, that of the first one, or of the second where
    the first has none.
    """
    match expression:
        case Apply(primitive, (first, second)) if primitive.name in PHI:
            channel = _input_of(first) or _input_of(second) or 1
            return Apply(primitive, (_lag_of(channel, first), _lag_of(channel, second)))
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(phi(argument) for argument in arguments))
        case Shift(samples, argument):
            return Shift(samples, phi(argument))
        case _:
            return expression


def _lag_of(channel: int, argument: Expression) -> Expression:
    """Put an input in the place of whatever else stands under an argument's back-shifts."""
    match argument:
        case Shift(samples, inner):
            return Shift(samples, _lag_of(channel, inner))
        case Lagged(own, _) if own == channel:
            return argument
    return Lagged(channel)


def with_phi(expression: Expression) -> Expression:
    """Write differences of two lags of one input, and their signs, as phi1 and phi2.

    Canonical form writes them ``sub`` and ``sign``, which variation would open to any argument.
    """
    if not isinstance(expression, Apply):
        return expression
    arguments = tuple(with_phi(argument) for argument in expression.arguments)
    match expression.primitive, arguments:
        case primitive, (first, second) if primitive == SUB and _same_input(first, second):
            return Apply(PRIMITIVES["phi1"], arguments)
        case primitive, (Apply(inner, lags),) if primitive == SIGN and inner.name == "phi1":
            return Apply(PRIMITIVES["phi2"], lags)
    return Apply(expression.primitive, arguments)


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


def _same_input(first: Expression, second: Expression) -> bool:
    """Tell whether two expressions are lags of one input."""
    return _input_of(first) == _input_of(second) > 0


def _input_of(expression: Expression) -> int:
    """Return the input that an expression is a lag of, 0 where it is anything else."""
    while isinstance(expression, Shift):
        expression = expression.argument
    return expression.channel if isinstance(expression, Lagged) else 0


STRUCTURES: Mapping[str, Structure] = MappingProxyType({"free": free, "phi": phi, "increment": increment})
