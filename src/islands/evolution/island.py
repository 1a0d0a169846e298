"""One island: its whole state as a value, and the step from one generation to the next."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from islands.evolution.evaluation import Evaluator
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.individual import Individual
from islands.evolution.rng import Purpose, Stream
from islands.evolution.selection import tournament
from islands.evolution.variation import (
    Genes,
    high_level_crossover,
    inner_mutation,
    legal,
    low_level_crossover,
    outer_mutation,
    random_genes,
)
from islands.model.expression import Expression

Population = tuple[Individual, ...]


@dataclass(frozen=True, slots=True)
class Island:
    """The whole state of an island's search.

    Attributes
    ----------
    index : int
        Its number; with seed and generation it determines every random number.
    seed : int
    generation : int
        How many steps it has taken; 0 is the evaluated first population.
    population : tuple of Individual
        The offspring of the last step, evaluated.
    elite : tuple of Individual
        The best of all so far, fittest first.
    hall : HallOfFame
    """

    index: int
    seed: int
    generation: int
    population: Population
    elite: Population
    hall: HallOfFame


@dataclass(frozen=True, slots=True)
class StepInfo:
    """What a watcher may want to know of a step; it never goes back into the search.

    Attributes
    ----------
    evaluations : int
        Individuals evaluated.
    duplicates : int
        Those among them whose structure had been evaluated before.
    outcomes : mapping
        Number of individuals by outcome.
    """

    evaluations: int
    duplicates: int
    outcomes: Mapping[str, int]


def first_generation(
    index: int, seed: int, evaluator: Evaluator, seeds: Sequence[Genes] = ()
) -> tuple[Island, StepInfo]:
    """Draw and evaluate a first population.

    Parameters
    ----------
    seeds : sequence of genes
        Individuals that are given; the others are drawn.
    """
    settings = evaluator.settings
    draw = Stream(seed, index, 0, Purpose.INITIAL)
    given = [legal(genes[: settings.max_terms], settings) for genes in seeds[: settings.population]]
    drawn = [
        random_genes(settings, evaluator.record.inputs, draw) for _ in range(settings.population - len(given))
    ]
    empty = Island(index, seed, 0, (), (), HallOfFame())
    return _evaluated(empty, [*given, *drawn], evaluator)


def step(island: Island, evaluator: Evaluator, pool: Sequence[Expression] = ()) -> tuple[Island, StepInfo]:
    """Breed, evaluate and select one generation (Figure 2).

    Parameters
    ----------
    pool : sequence of Expression
        Genes that an outer mutation may take whole.
    """
    settings, inputs = evaluator.settings, evaluator.record.inputs
    following = replace(island, generation=island.generation + 1)
    select = Stream(island.seed, island.index, following.generation, Purpose.SELECTION)
    draw = Stream(island.seed, island.index, following.generation, Purpose.VARIATION)
    parents = (*island.elite, *island.population)
    offspring: list[Genes] = []
    while len(offspring) < settings.population:
        pair = [tournament(parents, settings.tournament, select).genes for _ in range(2)]
        if draw.chance(settings.crossover):
            cross = high_level_crossover if draw.chance(settings.high_level) else low_level_crossover
            pair = list(cross(pair[0], pair[1], settings, draw))
        else:
            for position, genes in enumerate(pair):
                if draw.chance(settings.mutation):
                    pair[position] = (
                        outer_mutation(genes, settings, inputs, draw, pool)
                        if draw.chance(settings.outer)
                        else inner_mutation(genes, settings, inputs, draw)
                    )
        offspring += [legal(genes, settings) for genes in pair]
    return _evaluated(following, offspring[: settings.population], evaluator)


def _evaluated(island: Island, genes: Sequence[Genes], evaluator: Evaluator) -> tuple[Island, StepInfo]:
    settings = evaluator.settings
    draw = Stream(island.seed, island.index, island.generation, Purpose.PRUNING)
    # Every individual draws, whether its structure is known or not: a cache never changes what is bred.
    decided = [(Individual(each), draw.chance(settings.prune)) for each in genes]
    population, duplicates = evaluator.evaluate(decided)
    elite = _elite((*island.elite, *population), settings.elites, settings.distinct)
    info = StepInfo(
        len(population),
        duplicates,
        Counter(each.outcome.verdict.name.lower() for each in population),
    )
    return replace(
        island, population=population, elite=elite, hall=with_entries(island.hall, population)
    ), info


def _elite(union: Population, count: int, distinct: bool) -> Population:
    """Keep the fittest of old elite and offspring; ties go to the smaller, then to the structure's text."""
    ordered = sorted(union, key=lambda each: (each.fitness, each.size, each.key))
    if distinct:
        first: dict[tuple[str, ...], Individual] = {}
        for each in ordered:
            first.setdefault(each.key, each)
        ordered = list(first.values())
    return tuple(ordered[:count])
