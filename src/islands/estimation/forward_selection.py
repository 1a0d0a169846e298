"""Forward selection over a candidate library: the classical method and the baseline for evolution.

Under a constraint, the selection runs in the null space of the constraint. Fixed terms move to the target,
the rest of the library is rewritten as increments that preserve the constraint, and the error reduction
ratio (ERR) is computed for the increments. A selection that ignores the constraint would choose terms that
the constraint then forbids.
"""

from collections.abc import Sequence

from islands.data.dataset import Dataset
from islands.estimation.froe import froe
from islands.estimation.parameter_constraints import constraint
from islands.model.model import canonical_order
from islands.model.regressor import Regressor
from islands.program.regressor_matrix import gram_matrix
from islands.simulation.outcome import EvaluationOutcome

Structure = tuple[Regressor, ...]


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
    found = constraint(constraints).directions(library)
    if isinstance(found, EvaluationOutcome):
        return found
    warm_up = max(item.maximum_lag for item in library)
    # Ties go to the first candidate: take the one of the lowest degree.
    free = sorted(found.free, key=lambda direction: max(item.degree for item in direction.regressors))
    gram = gram_matrix([*(direction.expression for direction in free), found.target], record, warm_up)
    structures = [tuple(found.fixed)] if found.fixed else []
    selected: list[Regressor] = list(found.fixed)
    selection = froe(gram, max_terms=max_terms)
    remaining = 1.0
    for position, ratio in zip(selection.order, selection.err, strict=True):
        if ratio < least_gain * remaining:
            break
        remaining -= ratio
        selected += free[position].regressors
        structure = tuple(canonical_order(selected))
        if len(structure) > max_terms:
            break
        structures.append(structure)
    return tuple(structures)
