"""Table of parameter constraints that hold exactly for any data.

An entry groups regressors and prescribes the sum of the parameters of each group: ``S theta = c``. An entry
of `CONSTRAINTS` can be chosen by name, and the kernel of a search evaluates it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from islands.errors import lookup
from islands.model.clusters import OUTPUT_AT_REST, Cluster, clusters, steady_state
from islands.model.expression import Apply, Constant, Expression, Lagged
from islands.model.primitives import ADD, MUL
from islands.model.regressor import Regressor, canonical
from islands.simulation.outcome import EvaluationOutcome, Status


@dataclass(frozen=True, slots=True, eq=False)
class Constrained:
    """Regressors and the constraint ``S theta = c`` on their parameters.

    Attributes
    ----------
    regressors : tuple of Regressor
        Regressors whose parameter is not forced to zero.
    S : ndarray, shape (constraints, terms)
        Constraint matrix.
    c : ndarray, shape (constraints,)
        Right-hand side.
    """

    regressors: tuple[Regressor, ...]
    S: NDArray[np.float64]
    c: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Direction:
    """A direction of the null space: a candidate that a constrained model can add.

    Attributes
    ----------
    expression : Expression
        A regressor, or a difference of two regressors that preserves the sum of their cluster.
    regressors : tuple of Regressor
        Regressors that the model must then contain.
    """

    expression: Expression
    regressors: tuple[Regressor, ...]


@dataclass(frozen=True, slots=True)
class Directions:
    """The null space of a constraint over a library.

    Attributes
    ----------
    target : Expression
        Target of the selection: y(k) minus the part that the constraint fixes.
    fixed : tuple of Regressor
        Regressors of every model.
    free : tuple of Direction
        Candidates.
    """

    target: Expression
    fixed: tuple[Regressor, ...]
    free: tuple[Direction, ...]


@dataclass(frozen=True, slots=True)
class Constraint:
    """An entry of the table: sums of parameters over disjoint groups of regressors.

    Attributes
    ----------
    group : callable
        Maps a regressor to its weight in the sum and the key of its group. A weight of 0 means no group.
    sums : mapping
        Nonzero sums of the weighted parameters by group. A structure must contain these groups.
    lacking : str
        Reason of the failure of a structure that lacks one of these groups.
    directions : callable
        Maps a candidate library to the null space of the constraint.
    description : str
        One-line description.
    """

    group: Callable[[Regressor], tuple[float, Expression]]
    sums: Mapping[Expression, float]
    lacking: str
    directions: Callable[[Sequence[Regressor]], Directions | EvaluationOutcome]
    description: str

    def constrain(self, regressors: Sequence[Regressor]) -> Constrained | EvaluationOutcome:
        """Return the constraint on the given regressors.

        The only regressor of a group with sum zero has a zero parameter and is removed.
        """
        groups = clusters(regressors, self.group)
        singletons = {
            group.members[0]
            for group in groups
            if len(group.members) == 1 and group.steady_state not in self.sums
        }
        kept = tuple(item for position, item in enumerate(regressors) if position not in singletons)
        groups = clusters(kept, self.group)
        if not self.sums.keys() <= {group.steady_state for group in groups}:
            return EvaluationOutcome(Status.INFEASIBLE, self.lacking)
        S = np.zeros((len(groups), len(kept)))
        for row, group in enumerate(groups):
            S[row, group.members] = group.weights
        return Constrained(kept, S, np.array([self.sums.get(group.steady_state, 0.0) for group in groups]))


_PRESENT = Lagged(0, 0)

#: Property 1 (the paper, section 3): with these sums every output is an equilibrium at constant input.
PROPERTY_1: Mapping[Expression, float] = MappingProxyType({OUTPUT_AT_REST: 1.0})


def free(_regressor: Regressor) -> tuple[float, Expression]:
    """Assign the regressor to no group."""
    return 0.0, _PRESENT


def every_regressor(library: Sequence[Regressor]) -> Directions:
    """Return the unconstrained directions: every regressor is a candidate."""
    return Directions(_PRESENT, (), tuple(Direction(item.expression, (item,)) for item in library))


def increments(library: Sequence[Regressor]) -> Directions | EvaluationOutcome:
    """Return the directions that vanish in the steady state, which explain y(k) - y(k-1).

    They are the regressors with a phi factor and, within a cluster, the differences of a regressor and the
    cluster's first regressor. A model selected from them can meet the constraint.
    """
    groups = clusters(library)
    output = next((group for group in groups if is_output(group)), None)
    if output is None:
        return EvaluationOutcome(Status.INFEASIBLE, "no candidate is y at rest: add y(k-1) to the library")
    clustered = {member for group in groups for member in group.members}
    vanishing = [item for position, item in enumerate(library) if position not in clustered]
    free = [Direction(item.expression, (item,)) for item in vanishing]
    known = {direction.expression for direction in free}
    for group in groups:
        first, *others = (
            (library[member], weight) for member, weight in zip(group.members, group.weights, strict=True)
        )
        for other in others:
            expression = _difference(other, first)
            if expression not in known:
                free.append(Direction(expression, (other[0], first[0])))
    base, weight = library[output.members[0]], output.weights[0]
    return Directions(_difference((_PRESENT, 1.0), (base, weight)), (base,), tuple(free))


def _difference(
    left: tuple[Regressor | Expression, float], right: tuple[Regressor | Expression, float]
) -> Expression:
    """Return the difference of the two terms, each divided by its weight, up to a factor."""
    terms = [
        Apply(MUL, (Constant(sign / weight), item.expression if isinstance(item, Regressor) else item))
        for sign, (item, weight) in ((1.0, left), (-1.0, right))
    ]
    return canonical(Apply(ADD, tuple(terms)))[1]


def is_output(cluster: Cluster) -> bool:
    """Return whether the steady state of the cluster is y."""
    return cluster.steady_state == OUTPUT_AT_REST


CONSTRAINTS: Mapping[str, Constraint] = MappingProxyType(
    {
        "none": Constraint(free, {}, "", every_regressor, "parameters are free"),
        "hysteresis": Constraint(
            steady_state,
            PROPERTY_1,
            "no regressor is y at rest: add y(k-1)",
            increments,
            "a continuum of equilibria (Property 1)",
        ),
    }
)


def constraint(name: str) -> Constraint:
    """Return a constraint by name.

    Raises
    ------
    SettingsError
        No constraint has that name.
    """
    return lookup(CONSTRAINTS, name, "constraints")


def count_free_parameters(regressors: Sequence[Regressor], name: str) -> int:
    """Return the number of parameters that remain free: the dimension of the null space.

    A structure that cannot meet the constraint was not estimated under it; all of its parameters count.
    """
    constrained = constraint(name).constrain(regressors)
    if isinstance(constrained, EvaluationOutcome):
        return len(regressors)
    return len(constrained.regressors) - len(constrained.c)
