"""Constraint on a model: rows of ``S theta = c``, admissible regressors and signs of parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from islands.errors import SettingsError
from islands.estimation.constraints.elimination import eliminate
from islands.estimation.constraints.parts import (
    ClusterSums,
    Equality,
    FixedPoint,
    LinearEquality,
    ParameterSign,
    Part,
    StaticGain,
    Symmetry,
)
from islands.expressions.primitives import ADD, MUL
from islands.expressions.tree import Apply, Constant, Expression, Lagged
from islands.models.clusters import clusters
from islands.models.regressor import Regressor, canonical
from islands.simulation.outcome import EvaluationOutcome, Status

_PRESENT = Lagged(0, 0)


@dataclass(frozen=True, slots=True, eq=False)
class Constrained:
    """Regressors and the constraint ``S theta = c`` on their parameters.

    Attributes
    ----------
    regressors : tuple of Regressor
        Regressors whose parameter is not forced to zero.
    S : ndarray, shape (constraints, terms)
        Constraint matrix with independent rows.
    c : ndarray, shape (constraints,)
        Right-hand side.
    signs : ndarray, shape (terms,)
        1 if the parameter must not be negative, -1 if it must not be positive, otherwise 0.
    """

    regressors: tuple[Regressor, ...]
    S: NDArray[np.float64]
    c: NDArray[np.float64]
    signs: NDArray[np.float64]

    def enforce(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters that meet the constraint up to the rounding of the terms in it.

        Least squares scales the parameters by the norms of their columns. The rounding errors are relative to
        the largest contribution to the output, which may be far larger than the terms of a constraint.
        """
        found = eliminate(self.S, self.c)
        assert not isinstance(found, int), "the rows are consistent"
        pivots = list(found.pivots)
        corrected = theta.copy()
        corrected[pivots] = 0.0
        corrected[pivots] = found.fixed - found.share @ corrected
        return corrected

    def has_signs(self, theta: NDArray[np.float64]) -> bool:
        """Return whether every parameter has its sign."""
        return bool(np.all(self.signs * theta >= 0.0))


@dataclass(frozen=True, slots=True)
class Direction:
    """A direction of the null space: a candidate that a constrained model can add.

    Attributes
    ----------
    expression : Expression
        A regressor, or a combination of regressors that preserves the equalities.
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
    """A combination of the parts of a constraint.

    Attributes
    ----------
    parts : tuple of Part
    description : str
        One-line description of a constraint that has a name.
    """

    parts: tuple[Part, ...]
    description: str = ""

    @property
    def cluster_sums(self) -> ClusterSums | None:
        """Sums over disjoint groups of regressors, if they are constrained."""
        return next((part for part in self.parts if isinstance(part, ClusterSums)), None)

    @property
    def sums(self) -> Mapping[Expression, float]:
        """Nonzero sums by group."""
        return self.cluster_sums.sums if self.cluster_sums else {}

    @property
    def equalities(self) -> tuple[Equality, ...]:
        """Equalities in addition to the sums."""
        return tuple(part for part in self.parts if isinstance(part, Equality))

    @property
    def required(self) -> tuple[tuple[Regressor, ...], ...]:
        """Terms of which a structure must contain at least one, for every linear equality."""
        equalities = (part for part in self.parts if isinstance(part, LinearEquality) and part.target)
        return tuple(tuple(item for item, weight in part.weights.items() if weight) for part in equalities)

    @property
    def signs(self) -> Mapping[Regressor, int]:
        """Sign of the parameter by regressor."""
        return {part.regressor: part.sign for part in self.parts if isinstance(part, ParameterSign)}

    @property
    def allows_offsets(self) -> bool:
        """Whether the constraint on deviations from an offset equals that on the signals themselves."""
        return all(isinstance(part, ClusterSums) for part in self.parts)

    @property
    def lacking(self) -> str:
        """Reason of the failure of a structure that cannot meet the constraint."""
        if self.equalities or not self.cluster_sums:
            return "the terms cannot meet the constraints " + "; ".join(part.text for part in self.parts)
        return self.cluster_sums.lacking

    def group(self, regressor: Regressor) -> tuple[float, Expression]:
        """Return the weight of a regressor in the sum of its group, and the group; 0 for no group."""
        return self.cluster_sums.group(regressor) if self.cluster_sums else (0.0, _PRESENT)

    def weigh(self, regressor: Regressor) -> tuple[float, ...]:
        """Return the coefficients of a regressor's parameter in the equalities."""
        return tuple(part.weigh(regressor) for part in self.equalities)

    def admits(self, regressor: Regressor) -> bool:
        """Return whether a model may contain the regressor.

        A regressor of another parity, or without a finite coefficient in an equality, has the parameter zero.
        """
        symmetries = (part for part in self.parts if isinstance(part, Symmetry))
        return all(part.admits(regressor) for part in symmetries) and all(
            map(isfinite, self.weigh(regressor))
        )

    def constrain(self, regressors: Sequence[Regressor]) -> Constrained | EvaluationOutcome:
        """Return the constraint on the given regressors.

        Regressors whose parameter is zero in every solution are removed.
        """
        kept = tuple(filter(self.admits, regressors))
        while True:
            S, c = self._rows(kept)
            found = eliminate(S, c)
            if isinstance(found, int) or (regressors and not kept):
                return EvaluationOutcome(Status.INFEASIBLE, self.lacking)
            if not found.zeros:
                break
            kept = tuple(item for position, item in enumerate(kept) if position not in found.zeros)
        rows = list(found.rows)
        signs = np.array([self.signs.get(item, 0) for item in kept], np.float64)
        return Constrained(kept, S[rows], c[rows], signs)

    def directions(self, library: Sequence[Regressor]) -> Directions | EvaluationOutcome:
        """Return the null space over a library of candidates.

        Every independent row determines the parameter of its first candidate. Any other candidate and those
        that it affects make a direction. Directions of a single regressor come first.
        """
        items = tuple(filter(self.admits, library))
        S, c = self._rows(items)
        found = eliminate(S, c, first=True)
        if isinstance(found, int) or not items:
            return EvaluationOutcome(Status.INFEASIBLE, self.lacking)
        determined = [items[pivot] for pivot in found.pivots]
        fixed = [(-value, item) for value, item in zip(found.fixed, determined, strict=True) if value]
        target = _combine([(1.0, _PRESENT), *((value, item.expression) for value, item in fixed)])
        single: dict[Expression, Direction] = {}
        combined: dict[Expression, Direction] = {}
        for position, item in enumerate(items):
            if position in found.pivots:
                continue
            shares = [
                (-share, each) for share, each in zip(found.share[:, position], determined, strict=True)
            ]
            affected = [(share, each) for share, each in shares if share]
            expression = _combine([(1.0, item.expression), *((s, each.expression) for s, each in affected)])
            chosen = combined if affected else single
            chosen.setdefault(expression, Direction(expression, (item, *(each for _, each in affected))))
        others = [each for expression, each in combined.items() if expression not in single]
        return Directions(target, tuple(item for _, item in fixed), (*single.values(), *others))

    def check_inputs(self, inputs: int) -> None:
        """Check that the parts refer to the inputs of a record.

        Raises
        ------
        SettingsError
            An operating point has another number of inputs, or a term reads an input that does not exist.
        """
        for part in self.parts:
            needed, exact = _count_inputs(part)
            if needed > inputs or (exact and needed != inputs):
                raise SettingsError(
                    f"the constraint {part.text!r} has values or terms of {needed} inputs, but the record "
                    f"has {inputs}: correct one of them"
                )

    def _rows(self, regressors: Sequence[Regressor]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return all rows of ``S theta = c``; a required group without a member has a row of zeros."""
        groups = clusters(regressors, self.group)
        present = {group.steady_state for group in groups}
        missing = [total for state, total in self.sums.items() if state not in present]
        S = np.zeros((len(groups) + len(missing), len(regressors)))
        for row, group in enumerate(groups):
            S[row, group.members] = group.weights
        sums = [self.sums.get(group.steady_state, 0.0) for group in groups]
        targets = [part.target for part in self.equalities]
        weights = np.array([self.weigh(item) for item in regressors]).reshape(len(regressors), len(targets))
        return np.vstack([S, weights.T]), np.array([*sums, *missing, *targets], np.float64)


def _combine(terms: Sequence[tuple[float, Expression]]) -> Expression:
    """Return the weighted sum of expressions up to a factor; the first one has the weight 1."""
    if len(terms) == 1:
        return terms[0][1]
    weighted = tuple(Apply(MUL, (Constant(weight), expression)) for weight, expression in terms)
    return canonical(Apply(ADD, weighted))[1]


def _count_inputs(part: Part) -> tuple[int, bool]:
    """Return the number of inputs that a part needs, and whether the record must have exactly that many."""
    match part:
        case FixedPoint():
            return part.inputs, True
        case StaticGain():
            return (part.channel, False) if part.inputs is None else (part.inputs, True)
        case LinearEquality():
            return max(channel for item in part.weights for channel, _ in {*item.lags, (0, 0)}), False
        case ParameterSign():
            return max(channel for channel, _ in {*part.regressor.lags, (0, 0)}), False
    return 0, False
