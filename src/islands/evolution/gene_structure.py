"""Table of gene structures: constraints on the form of genes, and the repair of other genes."""

from collections.abc import Callable, Mapping
from operator import is_
from types import MappingProxyType

from islands.expressions.primitives import PRIMITIVES, SIGN, SUB
from islands.expressions.tree import Apply, Expression, Lagged, Shift

Structure = Callable[[Expression], Expression]

#: Functions whose arguments are lags of one input (the paper, sections 3 and 5.2).
PHI = ("phi1", "phi2")

#: y(k-1). Its steady-state value is y, so its parameter can make the sum of its cluster equal to 1.
LINEAR_OUTPUT = Lagged(0, 1)


def free(expression: Expression) -> Expression:
    """Return a gene unchanged."""
    return expression


def phi(expression: Expression) -> Expression:
    """Repair phi functions (Figure 3): replace arguments that are not lags of an input by such lags.

    The back-shifts are kept: ``phi1(q1(y(k-1)), q4(u(k-1)*y(k-1)))`` becomes
    ``phi1(q1(u(k-1)), q4(u(k-1)))``, as in the figure. Both arguments become lags of the same input: the
    input of the first argument, else of the second, else the first input.
    """
    match expression:
        case Apply(primitive, (first, second) as before) if primitive.name in PHI:
            channel = _get_input(first) or _get_input(second) or 1
            arguments = tuple(_replace_by_lag(channel, argument) for argument in before)
        case Apply(_, before):
            arguments = tuple(phi(argument) for argument in before)
        case Shift(samples, argument):
            repaired = phi(argument)
            return expression if repaired is argument else Shift(samples, repaired)
        case _:
            return expression
    # A valid gene stays the same object, whose number is found at once.
    unchanged = all(map(is_, arguments, before))
    return expression if unchanged else Apply(expression.primitive, arguments)


def _replace_by_lag(channel: int, argument: Expression) -> Expression:
    """Replace the expression under the back-shifts of an argument by an input."""
    match argument:
        case Shift(samples, inner):
            replaced = _replace_by_lag(channel, inner)
            return argument if replaced is inner else Shift(samples, replaced)
        case Lagged(found, _) if found == channel:
            return argument
    return Lagged(channel)


def with_phi(expression: Expression) -> Expression:
    """Replace differences of two lags of one input by phi1, and the signs of such differences by phi2.

    The canonical form uses ``sub`` and ``sign``, whose arguments variation could replace by any expression.
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
    """Repair phi functions, and replace linear output genes by y(k-1).

    Another lag, such as y(k-4), also satisfies the constraint on the sum of the parameters. But the model
    then consists of four interleaved solutions whose differences are not damped, and the free run diverges.
    """
    return LINEAR_OUTPUT if is_linear_output(expression) else phi(expression)


def is_linear_output(expression: Expression) -> bool:
    """Return whether an expression is a lag of the output."""
    while isinstance(expression, Shift):
        expression = expression.argument
    return isinstance(expression, Lagged) and expression.channel == 0


def _same_input(first: Expression, second: Expression) -> bool:
    """Return whether two expressions are lags of the same input."""
    return _get_input(first) == _get_input(second) > 0


def _get_input(expression: Expression) -> int:
    """Return the channel of the input that an expression is a lag of; 0 for any other expression."""
    while isinstance(expression, Shift):
        expression = expression.argument
    return expression.channel if isinstance(expression, Lagged) else 0


STRUCTURES: Mapping[str, Structure] = MappingProxyType({"free": free, "phi": phi, "increment": increment})
