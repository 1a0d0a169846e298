"""The table of parameter constraints: what a model's parameters must obey whatever the data say.

An entry groups regressors and says what the parameters of a group sum to: ``S theta = c``. Add one here and
it can be chosen by name; a search evaluates it in its kernel.
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


@dataclass(frozen=True, slots=True)
class Direction:
    """A way in which a constrained model may grow.

    Attributes
    ----------
    expression : Expression
        What is added: a regressor, or a difference of two that keeps their cluster's sum as it is.
    regressors : tuple of Regressor
        Those that the model then has.
    """

    expression: Expression
    regressors: tuple[Regressor, ...]


@dataclass(frozen=True, slots=True)
class Directions:
    """The null space of a constraint over a library, one direction a candidate.

    Attributes
    ----------
    target : Expression
        What the directions explain: y(k), less what the constraint fixes.
    fixed : tuple of Regressor
        Regressors that every model has.
    free : tuple of Direction
    """

    target: Expression
    fixed: tuple[Regressor, ...]
    free: tuple[Direction, ...]


@dataclass(frozen=True, slots=True)
class Constraint:
    """An entry of the table: sums of parameters over groups of regressors that have no member in common.

    Attributes
    ----------
    group : callable
        A regressor's weight in the sum, and what its group has in common; with the weight 0 it has no group.
    sums : mapping
        What the weighted parameters of a group sum to where that is not zero; a structure has to have these
        groups.
    lacking : str
        What is said of a structure that has not.
    directions : callable
        The same for a library from which regressors are selected.
    description : str
    """

    group: Callable[[Regressor], tuple[float, Expression]]
    sums: Mapping[Expression, float]
    lacking: str
    directions: Callable[[Sequence[Regressor]], Directions | EvaluationOutcome]
    description: str

    def constrain(self, regressors: Sequence[Regressor]) -> Constrained | EvaluationOutcome:
        """Return the constraint on given regressors.

        A regressor alone in a group that sums to zero has the parameter zero and is left out.
        """
        groups = clusters(regressors, self.group)
        alone = {
            group.members[0]
            for group in groups
            if len(group.members) == 1 and group.steady_state not in self.sums
        }
        kept = tuple(item for position, item in enumerate(regressors) if position not in alone)
        groups = clusters(kept, self.group)
        if not self.sums.keys() <= {group.steady_state for group in groups}:
            return EvaluationOutcome(Status.INFEASIBLE, self.lacking)
        S = np.zeros((len(groups), len(kept)))
        for row, group in enumerate(groups):
            S[row, group.members] = group.weights
        return Constrained(kept, S, np.array([self.sums.get(group.steady_state, 0.0) for group in groups]))


_PRESENT = Lagged(0, 0)

#: Property 1 of the paper, section 3: with these sums every output is an equilibrium at constant input.
PROPERTY_1: Mapping[Expression, float] = MappingProxyType({OUTPUT_AT_REST: 1.0})


def free(_regressor: Regressor) -> tuple[float, Expression]:
    """Put no regressor into any group."""
    return 0.0, _PRESENT


def every_regressor(library: Sequence[Regressor]) -> Directions:
    """Let a model grow by any regressor."""
    return Directions(_PRESENT, (), tuple(Direction(item.expression, (item,)) for item in library))


def increments(library: Sequence[Regressor]) -> Directions | EvaluationOutcome:
    """Let a model grow by what vanishes at rest: y(k) - y(k-1) is explained by increments alone.

    Within a cluster that is the difference of a regressor and the cluster's first; a regressor with a phi
    factor vanishes by itself. So the selection sees the constraint, and estimation has none left to repair.
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
    """Return ``left / its weight - right / its weight``, up to a factor."""
    terms = [
        Apply(MUL, (Constant(sign / weight), item.expression if isinstance(item, Regressor) else item))
        for sign, (item, weight) in ((1.0, left), (-1.0, right))
    ]
    return canonical(Apply(ADD, tuple(terms)))[1]


def is_output(cluster: Cluster) -> bool:
    """Tell whether a cluster is that of y itself."""
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
        There is none of that name.
    """
    return lookup(CONSTRAINTS, name, "constraints")
