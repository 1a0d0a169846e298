"""Search problem: the record, the settings, the seeds and the gene pool."""

from dataclasses import dataclass, replace

from islands.data.dataset import Dataset
from islands.estimation.forward_selection import forward_selection
from islands.estimation.input_ranking import screen_candidates
from islands.estimation.parameter_constraints import constraint
from islands.evolution.generation.variation import Genes
from islands.evolution.gp.gene_structure import with_phi
from islands.evolution.gp.island_profiles import ISLAND_PROFILES
from islands.evolution.settings import Settings
from islands.model.expression import Expression, height
from islands.simulation.outcome import EvaluationOutcome


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Search problem, shared by all islands.

    Attributes
    ----------
    record : Dataset
        Estimation data without missing values.
    settings : Settings
    seeds : tuple of genes
        Individuals in every first population, from forward selection over the library of the settings.
    pool : tuple of Expression
        Genes of that library, which an outer mutation may insert.
    """

    record: Dataset
    settings: Settings
    seeds: tuple[Genes, ...] = ()
    pool: tuple[Expression, ...] = ()

    def settings_of(self, island: int) -> Settings:
        """Return the settings of an island; profiles are assigned to the islands in turn."""
        profiles = self.settings.characters
        if not profiles:
            return self.settings
        return replace(self.settings, **ISLAND_PROFILES[profiles[island % len(profiles)]])


def make_problem(record: Dataset, settings: Settings) -> Problem:
    """Make a search problem; run the forward selection if the settings have a library.

    Regressors of the library that exceed the maximum height of a gene are left out.

    Raises
    ------
    SettingsError
        The library has too many candidates, or a constraint refers to an input that the record lacks.
    RecordError
        The record is incomplete, or not longer than the largest lag of the library.
    """
    constraint(settings.constraints).check_inputs(record.inputs)
    if not settings.library:
        return Problem(record, settings)
    regressors = screen_candidates(
        settings.library, settings.library_degree, settings.library_lags, record, settings.constraints
    )
    genes = {item: with_phi(item.expression) for item in regressors}
    admits = constraint(settings.constraints).admits
    library = [item for item in regressors if height(genes[item]) <= settings.max_height and admits(item)]
    selected = forward_selection(library, record, settings.constraints, settings.max_terms)
    structures = () if isinstance(selected, EvaluationOutcome) else selected
    return Problem(
        record,
        settings,
        tuple(tuple(genes[item] for item in structure) for structure in structures),
        tuple(genes[item] for item in library),
    )
