"""A problem: the record, the settings and what follows from them for every island."""

from dataclasses import dataclass, replace

from islands.data.dataset import Dataset
from islands.estimation.forward_selection import forward_selection
from islands.evolution.generation.variation import Genes
from islands.evolution.gp.gene_structure import with_phi
from islands.evolution.gp.island_profiles import ISLAND_PROFILES
from islands.evolution.settings import Settings
from islands.model.candidate_library import candidates
from islands.model.expression import Expression, height
from islands.simulation.outcome import EvaluationOutcome


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

    def settings_of(self, island: int) -> Settings:
        """Return the settings with what is different about an island; characters are given out in turn."""
        characters = self.settings.characters
        return (
            replace(self.settings, **ISLAND_PROFILES[characters[island % len(characters)]])
            if characters
            else self.settings
        )


def problem(record: Dataset, settings: Settings) -> Problem:
    """Pose a problem; with a library in the settings its forward selection is done here, once.

    Regressors of the library that are higher than a gene may be are left out.

    Raises
    ------
    SettingsError
        The library would have too many candidates.
    RecordError
        Its forward selection finds the record incomplete, or shorter than the library's deepest lag.
    """
    if not settings.library:
        return Problem(record, settings)
    every = candidates(settings.library, settings.library_degree, settings.library_lags, record.inputs)
    genes = {item: with_phi(item.expression) for item in every}
    library = [item for item in every if height(genes[item]) <= settings.max_height]
    found = forward_selection(library, record, settings.constraints, settings.max_terms)
    structures = () if isinstance(found, EvaluationOutcome) else found
    return Problem(
        record,
        settings,
        tuple(tuple(genes[item] for item in structure) for structure in structures),
        tuple(genes[item] for item in library),
    )
