"""Expressions as infix text: Python, C and MATLAB read the same, but for samples and names of functions."""

from collections.abc import Callable

from islands.errors import ModelError
from islands.model.expression import Apply, Constant, Expression, Lagged, Primitive

#: Primitives that every language has as operators.
OPERATORS = {"mul": "*", "add": " + ", "sub": " - "}


def infix(
    expression: Expression, signal: Callable[[int, int], str], function: Callable[[Primitive], str]
) -> str:
    """Write an expression.

    Parameters
    ----------
    expression : Expression
        In canonical form, with its back-shifts at the leaves.
    signal : callable
        ``signal(channel, lag)`` writes a sample.
    function : callable
        Returns the name by which a primitive is called; whoever does not know it raises.

    Raises
    ------
    ModelError
        The expression is not in canonical form.
    """
    match expression:
        case Lagged(channel, lag):
            return signal(channel, lag)
        case Constant(number):
            text = repr(float(number))
            return f"({text})" if text.startswith("-") else text
        case Apply(primitive, arguments):
            parts = [infix(argument, signal, function) for argument in arguments]
            if primitive.name in OPERATORS:
                # Operators of one kind are carried out from the left everywhere, as in `value`; the brackets
                # keep that order under a parameter, which the kernels multiply last.
                return f"({OPERATORS[primitive.name].join(parts)})"
            return f"{function(primitive)}({', '.join(map(_unbracketed, arguments, parts))})"
    raise ModelError(f"{expression!r} is not in canonical form: bring it there with `regressor`")


def _unbracketed(argument: Expression, text: str) -> str:
    """Write an argument of a function without brackets of its own."""
    return text[1:-1] if not isinstance(argument, Lagged) and text.startswith("(") else text
