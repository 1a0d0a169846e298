"""State of one island, and the step from one generation to the next."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite

from islands.evolution.evaluation import Evaluator
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.individual import Individual, Population, unique_niches, unique_structures
from islands.evolution.rng import Purpose, Stream
from islands.evolution.selection import run_tournaments
from islands.evolution.settings import Settings
from islands.evolution.variation import Genes, breed, random_individuals, repair_genes
from islands.expressions.tree import Expression
from islands.kernels.breeding import Individuals

#: Quantile of the parents' fitness that defines the abandon threshold.
_THRESHOLD_QUANTILE = 0.8

#: Part of the first population that seeds may take, if there are more seeds than sizes.
_SEEDED = 0.25


@dataclass(frozen=True, slots=True)
class Island:
    """Complete state of the search on one island.

    Attributes
    ----------
    index : int
        Number of the island. With seed and generation it determines every random number.
    seed : int
    generation : int
        Completed generations; 0 after the evaluation of the first population, -1 before.
    population : tuple of Individual
        Evaluated offspring of the last generation.
    elite : tuple of Individual
        Best individuals so far, fittest first.
    hall_of_fame : HallOfFame
    abandon_threshold : float
        Lower bound on the fitness of individuals whose evaluation was abandoned.
    """

    index: int
    seed: int
    generation: int
    population: Population
    elite: Population
    hall_of_fame: HallOfFame
    abandon_threshold: float = inf


@dataclass(frozen=True, slots=True)
class StepInfo:
    """Statistics of one generation. Never fed back into the search.

    Attributes
    ----------
    generation : int
    evaluations : int
        Individuals evaluated.
    duplicates : int
        Individuals whose structure occurs among the parents or earlier in the generation.
    outcomes : mapping
        Number of individuals by outcome.
    best : mapping
        Best fitness of every model size in the hall of fame of the island.
    """

    generation: int
    evaluations: int
    duplicates: int
    outcomes: Mapping[str, int]
    best: Mapping[int, float]


def first_generation(
    index: int,
    seed: int,
    evaluator: Evaluator,
    seeds: Sequence[Genes] = (),
    settings: Settings | None = None,
) -> tuple[Island, StepInfo]:
    """Draw and evaluate the first population.

    Parameters
    ----------
    seeds : sequence of genes
        Given individuals; the rest of the population is drawn at random.
    settings : Settings, optional
        Settings of this island, if its profile differs from the settings of the evaluator.
    """
    settings = settings or evaluator.settings
    rng = Stream(seed, index, 0, Purpose.INITIAL)
    given = [repair_genes(genes[: settings.max_terms], settings) for genes in seeds[: _count_seeds(settings)]]
    evaluator.prepare()
    genes = evaluator.gene_index
    drawn = random_individuals(
        settings.population - len(given), settings, evaluator.record.inputs, genes, rng
    )
    empty = Island(index, seed, 0, (), (), HallOfFame())
    return _evaluate_generation(empty, genes.number_genes([*given, *drawn]), evaluator, settings)


def _count_seeds(settings: Settings) -> int:
    """Return the number of seeds in the first population: one of every size, or a part of the population."""
    return min(settings.population, max(settings.max_terms, int(_SEEDED * settings.population)))


def step(
    island: Island, evaluator: Evaluator, pool: Sequence[Expression] = (), settings: Settings | None = None
) -> tuple[Island, StepInfo]:
    """Breed and evaluate one generation, and update elite and hall of fame (Figure 2).

    Parameters
    ----------
    pool : sequence of Expression
        Genes that an outer mutation may take whole.
    settings : Settings, optional
        See `first_generation`.
    """
    settings = settings or evaluator.settings
    following = replace(island, generation=island.generation + 1)
    select = Stream(island.seed, island.index, following.generation, Purpose.SELECTION)
    rng = Stream(island.seed, island.index, following.generation, Purpose.VARIATION)
    pairs = -(-settings.population // 2)
    parents = run_tournaments(
        (*island.elite, *island.population),
        2 * pairs,
        settings.tournament,
        select,
        island.abandon_threshold,
        evaluator.evaluate_abandoned,
    )
    evaluator.prepare()
    genes = evaluator.gene_index
    couples = genes.number_genes([parent.genes for parent in parents], settings.max_terms)
    children = breed(couples, settings, evaluator.record.inputs, genes, rng, pool)
    offspring = Individuals(*(array[: settings.population] for array in children))
    copied = None if settings.prune_copies else couples
    return _evaluate_generation(following, offspring, evaluator, settings, copied)


def _evaluate_generation(
    island: Island,
    individuals: Individuals,
    evaluator: Evaluator,
    settings: Settings,
    copied: Individuals | None = None,
) -> tuple[Island, StepInfo]:
    """Evaluate the individuals of a generation; copies of parents are not pruned, the others may be."""
    rng = Stream(island.seed, island.index, island.generation, Purpose.PRUNING)
    # Draw for every individual, also for known structures, so that caches never change the random stream.
    pruned = rng.draw(len(individuals.lengths)) < settings.prune
    if copied is not None:
        copies = set(map(bytes, copied.genes))
        pruned &= [bytes(each) not in copies for each in individuals.genes]
    threshold = _abandon_threshold(island, settings)
    thresholds = _thresholds_by_size(island.hall_of_fame, threshold, settings.max_terms)
    population, _ = evaluator.evaluate_genes(individuals, pruned, thresholds)
    worst = _elite_threshold(island, settings)
    contenders = (each for each in (*island.elite, *population) if each.fitness <= worst)
    elite = select_elite(contenders, settings.elites, settings.distinct, settings.niches)
    hall = with_entries(island.hall_of_fame, population)
    known = {each.key for each in (*island.elite, *island.population)}
    info = StepInfo(
        island.generation,
        len(population),
        len(population) - len({each.key for each in population} - known),
        dict(Counter(each.outcome.verdict.name.lower() for each in population)),
        {size: entry.fitness for size, entry in hall.best().items()},
    )
    return replace(
        island, population=population, elite=elite, hall_of_fame=hall, abandon_threshold=threshold
    ), info


def _elite_threshold(island: Island, settings: Settings) -> float:
    """Return the highest fitness that can enter the elite."""
    return island.elite[-1].fitness if len(island.elite) == settings.elites else inf


def _abandon_threshold(island: Island, settings: Settings) -> float:
    """Return the fitness above which an individual cannot enter the elite and rarely wins a tournament.

    It is a quantile of the parents' fitness, at most the highest known one, and not below the worst of a full
    elite.
    """
    known = sorted(each.fitness for each in (*island.elite, *island.population) if isfinite(each.fitness))
    position = int(_THRESHOLD_QUANTILE * (len(island.elite) + len(island.population)))
    return max(_elite_threshold(island, settings), known[min(position, len(known) - 1)] if known else inf)


def _thresholds_by_size(hall: HallOfFame, threshold: float, largest: int) -> list[float]:
    """Return the abandon threshold of every model size up to the largest.

    A threshold is never below the fitness that enters the hall of fame.
    """
    entry = hall.entry_thresholds()
    return [max(threshold, entry.get(size, inf)) for size in range(largest + 1)]


def select_elite(
    contenders: Iterable[Individual], count: int, distinct: bool, niches: bool = True
) -> Population:
    """Return the fittest individuals; ties are broken by size, then by the text of the structure.

    If they have to be distinct, every structure occurs once. With niches, the fittest of every niche then
    come first, and others only fill the elite.
    """
    ordered = sorted(contenders, key=_elite_order)
    if not distinct:
        return tuple(ordered[:count])
    structures = unique_structures(ordered)
    if not niches:
        return structures[:count]
    leading = unique_niches(structures)[:count]
    keys = {each.key for each in leading}
    others = [each for each in structures if each.key not in keys]
    return tuple(sorted((*leading, *others[: count - len(leading)]), key=_elite_order))


def _elite_order(individual: Individual) -> tuple[float, int, tuple[str, ...]]:
    return individual.fitness, individual.size, individual.key
