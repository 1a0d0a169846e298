"""Parity of expressions: what changing the sign of some signals does to their value."""

from collections.abc import Callable

from islands.expressions.primitives import ADD, MUL, SUB
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Shift


def parity(expression: Expression, is_reversed: Callable[[int], bool]) -> int:
    """Return the parity of an expression when the sign of some channels changes.

    Parameters
    ----------
    expression : Expression
    is_reversed : callable
        Whether the sign of a channel changes; channel 0 is y.

    Returns
    -------
    int
        1 if the value stays the same, -1 if its sign changes, and 0 if neither follows from the declared
        parities of the primitives. The result holds for every value of the signals, protected ones included.
    """
    match expression:
        case Lagged(channel, _):
            return -1 if is_reversed(channel) else 1
        case Constant():
            return 1
        case Shift(_, argument):
            return parity(argument, is_reversed)
        case Apply(primitive, arguments):
            found = [parity(argument, is_reversed) for argument in arguments]
    if all(entry == 1 for entry in found):
        return 1
    if primitive == MUL:
        return _multiply(found)
    if primitive in (ADD, SUB):
        return found[0] if len(set(found)) == 1 else 0
    return primitive.parity if found == [-1] else 0


def _multiply(parities: list[int]) -> int:
    product = 1
    for each in parities:
        product *= each
    return product
