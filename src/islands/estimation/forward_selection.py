"""Forward selection over a candidate library: the classical method and the baseline for evolution.

Under a constraint, the selection runs in the null space of the constraint. Fixed terms move to the target,
the rest of the library is rewritten as increments that preserve the constraint, and the error reduction
ratio (ERR) is computed for the increments. A selection that ignores the constraint would choose terms that
the constraint then forbids.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.estimation.constraints.conditions import Direction
from islands.estimation.parameter_constraints import constraint
from islands.estimation.structure_selection.froe import froe
from islands.expressions.tree import walk
from islands.models.narx import canonical_order
from islands.models.regressor import Regressor
from islands.program.regressor_matrix import gram_matrix
from islands.records.dataset import Dataset
from islands.rounding import RESOLUTION, ROUNDING
from islands.simulation.outcome import EvaluationOutcome

Structure = tuple[Regressor, ...]

#: Largest pool of a search that exchanges regressors.
MAX_POOL = 300


@dataclass(frozen=True, slots=True, eq=False)
class SelectionProblem:
    """Candidates of a selection and their inner products.

    Attributes
    ----------
    fixed : tuple of Regressor
        Regressors of every model.
    free : tuple of Direction
        Candidates. Ties go to the first.
    gram : ndarray, shape (candidates + 1, candidates + 1)
        Inner products of the candidates and, last, the target.
    rows : int
        Number of rows of the record in the inner products.
    """

    fixed: Structure
    free: tuple[Direction, ...]
    gram: NDArray[np.float64]
    rows: int

    def compose(self, positions: Sequence[int]) -> Structure:
        """Return the structure of the fixed regressors and some candidates, in canonical order."""
        chosen = [item for position in positions for item in self.free[position].regressors]
        return tuple(canonical_order([*self.fixed, *chosen]))


def make_selection_problem(
    library: Sequence[Regressor], record: Dataset, constraints: str = "none"
) -> SelectionProblem | EvaluationOutcome:
    """Compute the inner products of the candidates of a library under a constraint.

    Return INFEASIBLE if the library cannot meet the constraint.
    """
    found = constraint(constraints).directions(library)
    if isinstance(found, EvaluationOutcome):
        return found
    warm_up = max(item.maximum_lag for item in library)
    # Ties go to the first candidate: take the one of the lowest degree.
    free = sorted(found.free, key=lambda direction: max(item.degree for item in direction.regressors))
    gram = gram_matrix([*(direction.expression for direction in free), found.target], record, warm_up)
    rows = sum(max(0, length - warm_up) for length in record.segments)
    return SelectionProblem(found.fixed, tuple(free), gram, rows)


def forward_selection(
    library: Sequence[Regressor],
    record: Dataset,
    constraints: str = "none",
    max_terms: int = 10,
    least_gain: float = 0.0,
) -> tuple[Structure, ...] | EvaluationOutcome:
    """Return nested structures; each adds the candidate with the largest ERR to the previous one.

    Under a constraint, a candidate may consist of two regressors.

    Parameters
    ----------
    library : sequence of Regressor
        Candidates in canonical order. Ties go to the candidate of the lowest degree, then to the first.
    record : Dataset
    constraints : str
        Name of an entry of ``CONSTRAINTS``.
    max_terms : int
        Maximum number of regressors of a structure.
    least_gain : float
        Stop if the next candidate reduces the squared error by less than this fraction of it.

    Returns
    -------
    tuple of structures, or EvaluationOutcome
        Regressors in canonical order. INFEASIBLE if the library cannot meet the constraint.
    """
    problem = make_selection_problem(library, record, constraints)
    if isinstance(problem, EvaluationOutcome):
        return problem
    return select_forward(problem, max_terms, least_gain)


def select_forward(
    problem: SelectionProblem, max_terms: int = 10, least_gain: float = 0.0
) -> tuple[Structure, ...]:
    """Return nested structures, as `forward_selection`."""
    structures = [problem.fixed] if problem.fixed else []
    selection = froe(problem.gram, max_terms=max_terms)
    remaining = 1.0
    for count, ratio in enumerate(selection.err, start=1):
        if ratio < least_gain * remaining:
            break
        remaining -= ratio
        structure = problem.compose(selection.order[:count])
        if len(structure) > max_terms:
            break
        structures.append(structure)
    return tuple(structures)


def select_pool(
    library: Sequence[Regressor], problem: SelectionProblem, max_terms: int
) -> Sequence[Regressor]:
    """Return the regressors for a search by exchange.

    They are the library or, if it has more than `MAX_POOL`, the largest structure of forward selection and
    the candidates that would reduce its error most. Further steps of the selection would follow the rounding
    of the record: a few hundred rows are explained by fewer terms than the pool has.
    """
    if len(library) <= MAX_POOL:
        return library
    chosen = froe(problem.gram, max_terms=max_terms).order
    pool: dict[Regressor, None] = dict.fromkeys(problem.compose(chosen))
    for at in _rank_by_gain(problem.gram, chosen):
        added = dict.fromkeys(problem.free[at].regressors)
        if len(pool | added) > MAX_POOL:
            break
        pool |= added
    return tuple(canonical_order(pool))


def _rank_by_gain(gram: NDArray[np.float64], chosen: Sequence[int]) -> NDArray[np.int64]:
    """Return the candidates in the order of the errors that they reduce in addition to some of them."""
    with np.errstate(divide="ignore", invalid="ignore"):
        norms = np.sqrt(np.diag(gram))
        scaled = gram / norms[:, None] / norms
    parts = scaled[list(chosen)]
    explained = np.linalg.solve(parts[:, list(chosen)], parts)
    left = 1.0 - np.einsum("ij,ij->j", parts, explained)[:-1]
    gain = (scaled[:-1, -1] - np.einsum("ij,i->j", parts[:, :-1], explained[:, -1])) ** 2
    gain = np.divide(gain, left, out=np.zeros_like(gain), where=left > ROUNDING)
    return np.argsort(-np.nan_to_num(gain), kind="stable")


def find_simplest(problem: SelectionProblem) -> dict[Regressor, Regressor]:
    """Return the simplest regressor that has the same column on the record, for every candidate.

    The sign of a positive output is a constant, and its absolute value the output: rounding would choose.
    """
    single = [at for at, direction in enumerate(problem.free) if len(direction.regressors) == 1]
    items = [problem.free[at].regressors[0] for at in single]
    order = sorted(range(len(items)), key=lambda at: sum(1 for _ in walk(items[at].expression)))
    places = np.array([single[at] for at in order], np.int64)
    gram = problem.gram[np.ix_(places, places)]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        norms = np.sqrt(np.diag(gram))
        same = np.abs(gram / norms[:, None] / norms) >= 1.0 - RESOLUTION**2
    np.fill_diagonal(same, True)
    return {items[at]: items[order[first]] for at, first in zip(order, same.argmax(axis=0), strict=True)}
