"""Forward selection over a library: the classical answer, and the bar that evolution has to beat.

Under a constraint the selection runs in its null space: what is fixed goes to the target's side, the rest of
the library is written as increments that keep the constraint, and the error reduction ratio is that of the
increments. Selecting first and constraining afterwards would spend the ratio on terms that the constraint
then forbids.
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
    library: Sequence[Regressor], record: Dataset, constraints: str = "none", max_terms: int = 10
) -> tuple[Structure, ...] | EvaluationOutcome:
    """Return nested structures, each the one before it and the candidate with the largest ERR.

    Parameters
    ----------
    library : sequence of Regressor
        In the order of their content; ties go to the first.
    constraints : str
        An entry of ``CONSTRAINTS``.
    max_terms : int
        The largest structure's number of regressors.

    Returns
    -------
    tuple of structures, or EvaluationOutcome
        Regressors in the order of their content. INFEASIBLE where the library cannot meet the constraint.
    """
    found = constraint(constraints).directions(library)
    if isinstance(found, EvaluationOutcome):
        return found
    warm_up = max(item.maximum_lag for item in library)
    gram = gram_matrix([*(direction.expression for direction in found.free), found.target], record, warm_up)
    structures = [tuple(found.fixed)] if found.fixed else []
    chosen: list[Regressor] = list(found.fixed)
    for position in froe(gram, max_terms=max_terms).order:
        chosen += found.free[position].regressors
        structure = tuple(canonical_order(chosen))
        if len(structure) > max_terms:
            break
        structures.append(structure)
    return tuple(structures)
