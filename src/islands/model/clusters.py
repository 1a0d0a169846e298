"""Clusters: regressors that are the same function of the steady state, the paper's section 3.

At rest every lag of a signal has one value, ubar or ybar. A regressor with a phi factor is zero there and
belongs to no cluster. The others are put together when their steady states are proportional: y(k-1) u(k-4)
and y(k-6) u(k-10) both are ybar ubar. The sums of the parameters over each cluster decide the equilibria.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from islands.model.expression import Apply, Expression, Lagged, Shift, content
from islands.model.regressor import Regressor, canonical

#: The steady state of y(k-1): its cluster is the one that Property 1 wants to sum to 1.
OUTPUT_AT_REST = Lagged(0, 0)


@dataclass(frozen=True, slots=True)
class Cluster:
    """Regressors with proportional steady states.

    Attributes
    ----------
    steady_state : Expression
        Canonical, over signals of lag 0: ``Lagged(0, 0)`` is ybar.
    members : tuple of int
        Positions of the regressors.
    weights : tuple of float
        Each member at rest is its weight times the steady state.
    """

    steady_state: Expression
    members: tuple[int, ...]
    weights: tuple[float, ...]

    def total(self, theta: Sequence[float]) -> float:
        """Return the weighted sum of the members' parameters, the paper's Sigma."""
        return float(
            sum(weight * theta[member] for member, weight in zip(self.members, self.weights, strict=True))
        )


def steady_state(regressor: Regressor) -> tuple[float, Expression]:
    """Return (weight, expression) of a regressor at rest; the weight is 0 where a phi factor vanishes."""
    return canonical(_at_rest(regressor.expression))


def clusters(
    regressors: Sequence[Regressor],
    group: Callable[[Regressor], tuple[float, Expression]] = steady_state,
) -> tuple[Cluster, ...]:
    """Group the regressors that do not vanish at rest; clusters stand in the order of their content.

    Another ``group`` than the steady state may be given: a regressor's weight, 0 for none, and its group.
    """
    groups: dict[Expression, list[tuple[int, float]]] = {}
    for position, regressor in enumerate(regressors):
        weight, state = group(regressor)
        if weight:
            groups.setdefault(state, []).append((position, weight))
    return tuple(
        Cluster(
            state,
            tuple(position for position, _ in groups[state]),
            tuple(weight for _, weight in groups[state]),
        )
        for state in sorted(groups, key=content)
    )


def _at_rest(expression: Expression) -> Expression:
    match expression:
        case Lagged(channel, _):
            return Lagged(channel, 0)
        case Shift(_, argument):
            return _at_rest(argument)
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(_at_rest(argument) for argument in arguments))
        case _:
            return expression
