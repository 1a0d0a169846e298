"""Expressions as infix text. Python, C and MATLAB differ only in the syntax of samples and function names."""

from collections.abc import Callable

from islands.errors import ModelError
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Primitive

#: Primitives that are operators in every language.
OPERATORS = {"mul": "*", "add": " + ", "sub": " - "}


def infix(
    expression: Expression, signal: Callable[[int, int], str], function: Callable[[Primitive], str]
) -> str:
    """Return an expression as infix text.

    Parameters
    ----------
    expression : Expression
        In canonical form, with back-shifts at the leaves.
    signal : callable
        ``signal(channel, lag)`` returns the text of a sample.
    function : callable
        ``function(primitive)`` returns the name of a primitive's function.

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
                # All languages evaluate equal operators from left to right, as `value` does. The brackets
                # keep that order when the parameter is multiplied; the kernels multiply by it last.
                return f"({OPERATORS[primitive.name].join(parts)})"
            return f"{function(primitive)}({', '.join(map(_strip_brackets, arguments, parts))})"
    raise ModelError(f"{expression!r} is not in canonical form: bring it there with `regressor`")


def _strip_brackets(argument: Expression, text: str) -> str:
    """Return the text of a function argument without its outer brackets."""
    return text[1:-1] if not isinstance(argument, Lagged) and text.startswith("(") else text
