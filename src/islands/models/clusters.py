"""Clusters of regressors with the same steady state (the paper, section 3).

In the steady state all lags of a signal have the same value, ubar or ybar. A regressor with a phi factor is
then zero and belongs to no cluster. The others form a cluster if their steady states are proportional:
y(k-1) u(k-4) and y(k-6) u(k-10) both become ybar ubar. The sums of the parameters over the clusters determine
the equilibria.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from islands.expressions.tree import Apply, Expression, Lagged, Shift, content
from islands.models.regressor import Regressor, canonical

#: Steady state of y(k-1). Property 1 requires that the parameters of its cluster sum to 1.
OUTPUT_AT_REST = Lagged(0, 0)


@dataclass(frozen=True, slots=True)
class Cluster:
    """Regressors with proportional steady states.

    Attributes
    ----------
    steady_state : Expression
        Canonical expression in signals of lag 0: ``Lagged(0, 0)`` is ybar.
    members : tuple of int
        Positions of the regressors.
    weights : tuple of float
        Ratio of each member's steady state to ``steady_state``.
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
    """Return (weight, expression) of a regressor's steady state; the weight is 0 if a phi factor vanishes."""
    return canonical(_remove_lags(regressor.expression))


def clusters(
    regressors: Sequence[Regressor],
    group: Callable[[Regressor], tuple[float, Expression]] = steady_state,
) -> tuple[Cluster, ...]:
    """Group the regressors that do not vanish in the steady state; clusters are in canonical order.

    Parameters
    ----------
    regressors : sequence of Regressor
    group : callable
        Maps a regressor to its weight (0 if it belongs to no group) and its group.
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


def _remove_lags(expression: Expression) -> Expression:
    match expression:
        case Lagged(channel, _):
            return Lagged(channel, 0)
        case Shift(_, argument):
            return _remove_lags(argument)
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(_remove_lags(argument) for argument in arguments))
        case _:
            return expression
