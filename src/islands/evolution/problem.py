"""Search problem of genes: record, settings, seeds and gene pool; the steps of its islands."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import cast

from islands.available_cpus import count_cpus
from islands.estimation.forward_selection import make_selection_problem, select_forward, select_pool
from islands.estimation.parameter_constraints import constraint
from islands.estimation.structure_selection.deviations import Offsets
from islands.estimation.structure_selection.input_ranking import screen_candidates
from islands.evolution.archipelago import Island, StepInfo
from islands.evolution.engine import Caches
from islands.evolution.evaluation import Evaluator
from islands.evolution.gene_structure import with_phi
from islands.evolution.generation import first_generation, select_elite, step
from islands.evolution.individual import AnyIndividual, Individual, Population, require_genes
from islands.evolution.settings import ISLAND_PROFILES, Settings
from islands.evolution.swap_search import swap_search
from islands.evolution.variation import Genes
from islands.expressions.tree import Expression, height
from islands.models.narx import Model
from islands.models.regressor import Regressor
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome, Status


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Search problem, shared by all islands.

    Attributes
    ----------
    record : Dataset
        Estimation data without missing values.
    settings : Settings
    seeds : tuple of genes
        Structures over the library of the settings, from forward selection or, if the settings ask for it,
        from a swap search; the best of every size first. They start the first population of every island.
    pool : tuple of Expression
        Genes of that library, which an outer mutation may insert.
    offsets : tuple of float
        Constants that were subtracted from the output and from every input; empty if there were none.
    """

    record: Dataset
    settings: Settings
    seeds: tuple[Genes, ...] = ()
    pool: tuple[Expression, ...] = ()
    offsets: Offsets = ()

    def settings_of(self, island: int) -> Settings:
        """Return the settings of an island; profiles are assigned to the islands in turn."""
        profiles = self.settings.characters
        if not profiles:
            return self.settings
        return replace(self.settings, **ISLAND_PROFILES[profiles[island % len(profiles)]])

    def make_model(self, individual: AnyIndividual) -> Model:
        """Return the model of an individual for the signals minus the offsets; see `SearchProblem`."""
        genes, record = require_genes(individual), self.record
        return Model(
            genes.regressors, genes.theta, input_names=record.input_names, output_name=record.output_name
        )

    def open(self, threads: int = 1) -> "GeneEvolution":
        """Return the steps of the islands in this process; see `SearchProblem`."""
        return GeneEvolution(self, Evaluator(self.record, self.settings, threads=threads))


@dataclass(frozen=True, slots=True, eq=False)
class GeneEvolution:
    """Steps of the islands of a problem of genes in one process.

    Attributes
    ----------
    problem : Problem
    evaluator : Evaluator
        Of the record of the problem.
    """

    problem: Problem
    evaluator: Evaluator

    @property
    def memory(self) -> Caches:
        """Memory of the caches."""
        return self.evaluator.memory

    def first_generation(self, index: int, seed: int) -> tuple[Island, StepInfo]:
        """Draw and evaluate the first population of an island."""
        settings = self.problem.settings_of(index)
        return first_generation(index, seed, self.evaluator, self.problem.seeds, settings)

    def step(self, island: Island) -> tuple[Island, StepInfo]:
        """Breed and evaluate one generation."""
        return step(island, self.evaluator, self.problem.pool, self.problem.settings_of(island.index))

    def complete_fitness(self, population: Sequence[AnyIndividual]) -> list[float]:
        """Return the fitness of each individual; abandoned individuals are evaluated completely."""
        genes = cast("Sequence[Individual]", population)
        fitness = [individual.fitness for individual in genes]
        places = [
            place for place, individual in enumerate(genes) if individual.outcome.verdict is Status.ABANDONED
        ]
        evaluated = self.evaluator.evaluate_abandoned([genes[place] for place in places])
        for place, individual in zip(places, evaluated, strict=True):
            fitness[place] = individual.fitness
        return fitness

    def select_elite(self, contenders: Sequence[AnyIndividual], island: int) -> Population:
        """Return the elite of an island among contenders, fittest first."""
        settings = self.problem.settings_of(island)
        genes = cast("Sequence[Individual]", contenders)
        return select_elite(genes, settings.elites, settings.distinct, settings.niches)


def make_problem(record: Dataset, settings: Settings, steps: Steps | None = None) -> Problem:
    """Make a search problem; run the forward selection if the settings have a library.

    Regressors of the library that exceed the maximum height of a gene are left out.

    Parameters
    ----------
    record : Dataset
    settings : Settings
    steps : Steps, optional
        Steps of the selection and of the swap search.

    Raises
    ------
    StoppedError
        A stop is requested before the selection.
    SettingsError
        The library has too many candidates, or a constraint refers to an input that the record lacks.
    RecordError
        The record is incomplete, or not longer than the largest lag of the library.
    """
    steps = steps or Steps()
    constraint(settings.constraints).check_inputs(record.inputs)
    if not settings.library:
        return Problem(record, settings)
    regressors = screen_candidates(
        settings.library,
        settings.library_degree,
        settings.library_lags,
        record,
        settings.constraints,
        settings.library_delays,
    )
    genes = {item: with_phi(item.expression) for item in regressors}
    admits = constraint(settings.constraints).admits
    library = [item for item in regressors if height(genes[item]) <= settings.max_height and admits(item)]
    seeds: tuple[Genes, ...] = ()
    exchanged: Sequence[Regressor] = library
    steps(f"forward selection among {len(library)} candidates", 0.0)
    selection = make_selection_problem(library, record, settings.constraints)
    if not isinstance(selection, EvaluationOutcome):
        structures = select_forward(selection, settings.max_terms)
        seeds = tuple(tuple(genes[item] for item in structure) for structure in structures)
        if settings.swap_search:
            exchanged = select_pool(library, selection, settings.max_terms)
    if settings.swap_search:
        pool = [genes[item] for item in exchanged]
        evaluator = Evaluator(record, settings, threads=count_cpus())
        by_size = swap_search(evaluator, pool, seeds, steps=steps)
        seeds = tuple(each.genes for rank in zip_longest(*by_size) for each in rank if each is not None)
    return Problem(record, settings, seeds, tuple(genes[item] for item in library))
