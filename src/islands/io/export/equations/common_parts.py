"""Common parts of expressions: parts that occur repeatedly are computed once."""

from collections import Counter
from collections.abc import Iterator, Sequence

from islands.systems.ode.ode_expression import OdeExpression, Operation, Symbol

#: Least number of operations of a part that gets a name.
_MIN_OPERATIONS = 4


def take_common_parts(
    expressions: Sequence[OdeExpression], prefix: str
) -> tuple[list[tuple[str, OdeExpression]], list[OdeExpression]]:
    """Give names to the parts that occur repeatedly in expressions.

    Returns
    -------
    list of (str, expression)
        Names, which begin with ``prefix``, and parts, in an order in which each one follows those it reads.
    list of expression
        The expressions with these names.
    """
    parts: list[tuple[str, OdeExpression]] = []
    remaining = list(expressions)
    while True:
        counts = Counter(each for one in [*remaining, *(part for _, part in parts)] for each in _walk(one))
        repeated = [each for each, count in counts.items() if count > 1 and _count(each) >= _MIN_OPERATIONS]
        if not repeated:
            return parts[::-1], remaining
        largest = max(repeated, key=_count)
        name = f"{prefix}{len(parts) + 1}"
        remaining = [_replace(each, largest, Symbol(name)) for each in remaining]
        parts = [(known, _replace(part, largest, Symbol(name))) for known, part in parts]
        parts.append((name, largest))


def _walk(expression: OdeExpression) -> Iterator[OdeExpression]:
    if isinstance(expression, Operation):
        yield expression
        for argument in expression.arguments:
            yield from _walk(argument)


def _count(expression: OdeExpression) -> int:
    return sum(1 for _ in _walk(expression))


def _replace(expression: OdeExpression, part: OdeExpression, by: OdeExpression) -> OdeExpression:
    if expression == part:
        return by
    if isinstance(expression, Operation):
        arguments = tuple(_replace(each, part, by) for each in expression.arguments)
        return Operation(expression.function, arguments)
    return expression
