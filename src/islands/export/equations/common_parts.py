"""Common parts of expressions: parts that occur repeatedly are computed once."""

from collections import Counter
from collections.abc import Sequence

from islands.expressions.tree import Apply, Expression, Symbol, replace, walk

#: Least number of operations of a part that gets a name.
_MIN_OPERATIONS = 4


def take_common_parts(
    expressions: Sequence[Expression], prefix: str
) -> tuple[list[tuple[str, Expression]], list[Expression]]:
    """Give names to the parts that occur repeatedly in expressions.

    Returns
    -------
    list of (str, expression)
        Names, which begin with ``prefix``, and parts, in an order in which each one follows those it reads.
    list of expression
        The expressions with these names.
    """
    parts: list[tuple[str, Expression]] = []
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


def _walk(expression: Expression) -> list[Expression]:
    return [part for part in walk(expression) if isinstance(part, Apply)]


def _count(expression: Expression) -> int:
    return len(_walk(expression))


def _replace(expression: Expression, part: Expression, name: Symbol) -> Expression:
    return replace(expression, lambda each: name if each == part else None)
