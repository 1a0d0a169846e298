"""The table of parameter constraints: what a model's parameters must obey whatever the data say.

An entry turns regressors into ``S theta = c``. Add one here and it can be chosen by name.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from islands.model.clusters import OUTPUT_AT_REST, Cluster, clusters
from islands.model.expression import Expression
from islands.model.regressor import Regressor
from islands.simulation.outcome import Outcome, Verdict


@dataclass(frozen=True, slots=True, eq=False)
class Constrained:
    """Regressors that can meet a constraint, and the constraint on their parameters.

    Attributes
    ----------
    regressors : tuple of Regressor
        Those whose parameter is not forced to zero.
    S : ndarray, shape (constraints, terms)
    c : ndarray, shape (constraints,)
    """

    regressors: tuple[Regressor, ...]
    S: NDArray[np.float64]
    c: NDArray[np.float64]


Constraint = Callable[[Sequence[Regressor]], Constrained | Outcome]


def unconstrained(regressors: Sequence[Regressor]) -> Constrained:
    """Leave every parameter free."""
    return Constrained(tuple(regressors), np.empty((0, len(regressors))), np.empty(0))


def continuum_of_equilibria(regressors: Sequence[Regressor]) -> Constrained | Outcome:
    """Make every output an equilibrium at constant input: Property 1 of the paper, section 3.

    The parameters of the cluster y sum to 1, those of every other cluster to 0. A regressor alone in another
    cluster than y has the parameter zero and is left out. Without a cluster y the structure is infeasible.
    """
    groups = clusters(regressors)
    alone = {group.members[0] for group in groups if len(group.members) == 1 and not is_output(group)}
    kept = tuple(item for position, item in enumerate(regressors) if position not in alone)
    groups = clusters(kept)
    if not any(is_output(group) for group in groups):
        return Outcome(Verdict.INFEASIBLE, "no regressor is y at rest: add y(k-1)")
    S = np.zeros((len(groups), len(kept)))
    for row, group in enumerate(groups):
        S[row, group.members] = group.weights
    return Constrained(kept, S, np.array([target(group.steady_state) for group in groups]))


def target(steady_state: Expression) -> float:
    """Return what the parameters of a cluster sum to when there is a continuum of equilibria."""
    return 1.0 if steady_state == OUTPUT_AT_REST else 0.0


def is_output(cluster: Cluster) -> bool:
    """Tell whether a cluster is that of y itself."""
    return cluster.steady_state == OUTPUT_AT_REST


CONSTRAINTS: Mapping[str, Constraint] = MappingProxyType(
    {"none": unconstrained, "hysteresis": continuum_of_equilibria}
)
