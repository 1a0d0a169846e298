"""A problem: the record, the settings and what follows from them for every island."""

from dataclasses import dataclass

from islands.data.dataset import Dataset
from islands.estimation.forward_selection import forward_selection
from islands.evolution.settings import Settings
from islands.evolution.variation import Genes
from islands.model.expression import Expression
from islands.model.library import candidates
from islands.simulation.outcome import Outcome


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """What islands search for, and where.

    Attributes
    ----------
    record : Dataset
        The estimation data, complete.
    settings : Settings
    seeds : tuple of genes
        Individuals that every first population begins with: the forward selection over the settings' library.
    pool : tuple of Expression
        Genes that an outer mutation may take whole: that library.
    """

    record: Dataset
    settings: Settings
    seeds: tuple[Genes, ...] = ()
    pool: tuple[Expression, ...] = ()


def problem(record: Dataset, settings: Settings) -> Problem:
    """Pose a problem; with a library in the settings its forward selection is done here, once.

    Raises
    ------
    RecordError
        The record is incomplete or shorter than the deepest lag.
    """
    if not settings.library:
        return Problem(record, settings)
    library = candidates(settings.library, settings.library_degree, settings.library_lags, record.inputs)
    found = forward_selection(library, record, settings.constraints, settings.max_terms)
    structures = () if isinstance(found, Outcome) else found
    return Problem(
        record,
        settings,
        tuple(tuple(item.expression for item in structure) for structure in structures),
        tuple(item.expression for item in library),
    )
