"""Generations of an island whose individuals are vectors of genes."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from math import inf
from typing import cast

import numpy as np
from numpy.typing import NDArray

from islands.evolution.archipelago import Island, StepInfo
from islands.evolution.evaluation import Evaluator
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.individual import Individual, Population, unique_niches, unique_structures
from islands.evolution.offspring import Offspring, Parents, join, read_fitness
from islands.evolution.rng import Purpose, Stream
from islands.evolution.settings import Settings
from islands.evolution.variation import Genes, breed, random_individuals, repair_genes
from islands.expressions.tree import Expression
from islands.kernels.breeding import Individuals, take

#: Evaluates abandoned individuals, given by their places, completely; returns their fitness.
EvaluateAbandoned = Callable[[NDArray[np.int64]], NDArray[np.float64]]

#: Quantile of the parents' fitness that defines the abandon threshold.
_THRESHOLD_QUANTILE = 0.8

#: Part of the first population that seeds may take, if there are more seeds than sizes.
_SEEDED = 0.25


def run_tournaments(
    fitness: NDArray[np.float64],
    abandoned: NDArray[np.bool_],
    count: int,
    contestants: int,
    rng: Stream,
    abandon_threshold: float,
    evaluate_abandoned: EvaluateAbandoned,
) -> NDArray[np.int64]:
    """Run tournaments among contestants drawn with replacement and return the places of the winners.

    The fittest contestant wins; the first drawn wins a tie.

    Parameters
    ----------
    fitness : ndarray of float64, shape (individuals,)
        Infinite for abandoned individuals and failures.
    abandoned : ndarray of bool, shape (individuals,)
        Individuals whose evaluation was abandoned.
    count : int
        Number of tournaments.
    contestants : int
        Contestants of each tournament.
    abandon_threshold : float
        Lower bound on the fitness of abandoned individuals.
    evaluate_abandoned : callable
        Evaluates abandoned individuals completely. It is called only for those that may win, so the winners
        do not depend on which individuals were abandoned.
    """
    drawn = (rng.draw(count * contestants) * len(fitness)).astype(np.int64).reshape(count, contestants)
    is_open = fitness[drawn].min(axis=1) > abandon_threshold
    undecided = np.unique(drawn[is_open][abandoned[drawn[is_open]]])
    known = fitness.copy()
    known[undecided] = evaluate_abandoned(undecided)
    first = known[drawn].argmin(axis=1, keepdims=True)
    return np.take_along_axis(drawn, first, axis=1)[:, 0]


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
    first = genes.number_genes([*given, *drawn])
    return _evaluate_generation(empty, first, evaluator, settings, evaluator.read(()))


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
    evaluator.prepare()
    parents = join(*map(evaluator.read, _read_individuals(island)))

    def evaluate_abandoned(places: NDArray[np.int64]) -> NDArray[np.float64]:
        evaluated, _ = evaluator.evaluate_genes(take(parents.genes, places), np.zeros(len(places), np.bool_))
        return evaluated.parents.fitness

    winners = run_tournaments(
        parents.fitness,
        parents.abandoned,
        2 * pairs,
        settings.tournament,
        select,
        island.abandon_threshold,
        evaluate_abandoned,
    )
    genes, couples = evaluator.gene_index, take(parents.genes, winners)
    children = breed(couples, settings, evaluator.record.inputs, genes, rng, pool)
    offspring = Individuals(*(array[: settings.population] for array in children))
    copied = None if settings.prune_copies else couples
    return _evaluate_generation(following, offspring, evaluator, settings, parents, copied)


def _evaluate_generation(
    island: Island,
    individuals: Individuals,
    evaluator: Evaluator,
    settings: Settings,
    parents: Parents,
    copied: Individuals | None = None,
) -> tuple[Island, StepInfo]:
    """Evaluate the individuals of a generation; copies of parents are not pruned, the others may be."""
    rng = Stream(island.seed, island.index, island.generation, Purpose.PRUNING)
    # Draw for every individual, also for known structures, so that caches never change the random stream.
    pruned = rng.draw(len(individuals.lengths)) < settings.prune
    if copied is not None:
        copies = set(map(bytes, copied.genes))
        pruned &= [bytes(genes) not in copies for genes in individuals.genes]
    threshold = _abandon_threshold(island, settings)
    thresholds = _thresholds_by_size(island.hall_of_fame, threshold, settings.max_terms)
    population, _ = evaluator.evaluate_genes(individuals, pruned, thresholds)
    first = np.unique(population.places, return_index=True)[1]
    rows = np.sort(first) if settings.distinct else np.arange(len(population))
    contenders = population.take(rows[population.fitness[rows] <= _elite_threshold(island, settings)])
    elite, _ = _read_individuals(island)
    selected = select_elite((*elite, *contenders), settings.elites, settings.distinct, settings.niches)
    hall = with_entries(island.hall_of_fame, population.take(_find_entries(population, first, island)))
    info = StepInfo(
        island.generation,
        len(population),
        len(population) - int((~np.isin(population.places[first], parents.places)).sum()),
        dict(Counter(outcome.verdict.name.lower() for outcome in population.outcomes)),
        {size: entry.fitness for size, entry in hall.best().items()},
    )
    return replace(
        island, population=population, elite=selected, hall_of_fame=hall, abandon_threshold=threshold
    ), info


def _read_individuals(island: Island) -> tuple[Population, Sequence[Individual]]:
    """Return the elite and the population of an island, which consist of genes."""
    return cast("Population", island.elite), cast("Sequence[Individual]", island.population)


def _find_entries(population: Offspring, rows: NDArray[np.int64], island: Island) -> NDArray[np.int64]:
    """Return the rows whose fitness is good enough for the hall of fame."""
    entry, sizes = island.hall_of_fame.entry_thresholds(), population.sizes[rows]
    worst = np.array([entry.get(size, inf) for size in range(int(sizes.max(initial=0)) + 1)])
    fitness = population.fitness[rows]
    return rows[np.isfinite(fitness) & (fitness <= worst[sizes])]


def _elite_threshold(island: Island, settings: Settings) -> float:
    """Return the highest fitness that can enter the elite."""
    return island.elite[-1].fitness if len(island.elite) == settings.elites else inf


def _abandon_threshold(island: Island, settings: Settings) -> float:
    """Return the fitness above which an individual cannot enter the elite and rarely wins a tournament.

    It is a quantile of the parents' fitness, at most the highest known one, and not below the worst of a full
    elite.
    """
    fitness = np.concatenate([*map(read_fitness, _read_individuals(island))])
    known = np.sort(fitness[np.isfinite(fitness)])
    position = min(int(_THRESHOLD_QUANTILE * len(fitness)), len(known) - 1)
    return max(_elite_threshold(island, settings), float(known[position]) if len(known) else inf)


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
    others = [structure for structure in structures if structure.key not in keys]
    return tuple(sorted((*leading, *others[: count - len(leading)]), key=_elite_order))


def _elite_order(individual: Individual) -> tuple[float, int, tuple[str, ...]]:
    return individual.fitness, individual.size, individual.key
