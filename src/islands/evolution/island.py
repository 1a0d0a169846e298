"""One island: its whole state as a value, and the step from one generation to the next."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite

from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.generation.selection import tournaments
from islands.evolution.generation.variation import (
    Genes,
    high_level_crossover,
    inner_mutation,
    legal,
    low_level_crossover,
    outer_mutation,
    random_genes,
    with_linear_output,
)
from islands.evolution.gp.individual import Individual, Population, unique_structures
from islands.evolution.gp.rng import Purpose, Stream
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.settings import Settings
from islands.model.expression import Expression

#: Share of the parents that are better than the bar.
_MIDDLE = 0.8


@dataclass(frozen=True, slots=True)
class Island:
    """The whole state of an island's search.

    Attributes
    ----------
    index : int
        Its number; with seed and generation it determines every random number.
    seed : int
    generation : int
        How many steps it has taken; 0 is the evaluated first population, -1 before it.
    population : tuple of Individual
        The offspring of the last step, evaluated.
    elite : tuple of Individual
        The best of all so far, fittest first.
    hall_of_fame : HallOfFame
    abandon_threshold : float
        Whoever of the population was abandoned is less fit than this.
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
    """What a watcher may want to know of a step; it never goes back into the search.

    Attributes
    ----------
    generation : int
    evaluations : int
        Individuals evaluated.
    duplicates : int
        Those among them whose structure a parent has, or one of their generation before them.
    outcomes : mapping
        Number of individuals by outcome.
    best : mapping
        The least fitness of every size in the island's hall of fame.
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
    """Draw and evaluate a first population.

    Parameters
    ----------
    seeds : sequence of genes
        Individuals that are given; the others are drawn.
    settings : Settings, optional
        Those of this island, where its character makes it breed in another way than the evaluator's.
    """
    settings = settings or evaluator.settings
    draw = Stream(seed, index, 0, Purpose.INITIAL)
    given = [legal(genes[: settings.max_terms], settings) for genes in seeds[: settings.population]]
    drawn = [
        random_genes(settings, evaluator.record.inputs, draw) for _ in range(settings.population - len(given))
    ]
    empty = Island(index, seed, 0, (), (), HallOfFame())
    return _evaluated(empty, [*given, *drawn], evaluator, settings)


def step(
    island: Island, evaluator: Evaluator, pool: Sequence[Expression] = (), settings: Settings | None = None
) -> tuple[Island, StepInfo]:
    """Breed, evaluate and select one generation (Figure 2).

    Parameters
    ----------
    pool : sequence of Expression
        Genes that an outer mutation may take whole.
    settings : Settings, optional
        See `first_generation`.
    """
    settings, inputs = settings or evaluator.settings, evaluator.record.inputs
    following = replace(island, generation=island.generation + 1)
    select = Stream(island.seed, island.index, following.generation, Purpose.SELECTION)
    draw = Stream(island.seed, island.index, following.generation, Purpose.VARIATION)
    pairs = -(-settings.population // 2)
    parents = tournaments(
        (*island.elite, *island.population),
        2 * pairs,
        settings.tournament,
        select,
        island.abandon_threshold,
        evaluator.settled,
    )
    offspring: list[Genes] = []
    for couple in range(pairs):
        pair = [parent.genes for parent in parents[2 * couple : 2 * couple + 2]]
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
        offspring += [with_linear_output(genes, settings) for genes in pair]
    return _evaluated(following, offspring[: settings.population], evaluator, settings)


def _evaluated(
    island: Island, genes: Sequence[Genes], evaluator: Evaluator, settings: Settings
) -> tuple[Island, StepInfo]:
    draw = Stream(island.seed, island.index, island.generation, Purpose.PRUNING)
    # Every individual draws, whether its structure is known or not: a cache never changes what is bred.
    decided = [(Individual(each), draw.chance(settings.prune)) for each in genes]
    bar = _bar(island, settings)
    population, _ = evaluator.evaluate(decided, _bars(island.hall_of_fame, bar, settings.max_terms))
    worst = _worst(island, settings)
    contenders = (each for each in (*island.elite, *population) if each.fitness <= worst)
    elite = select_elite(contenders, settings.elites, settings.distinct)
    hall = with_entries(island.hall_of_fame, population)
    known = {each.key for each in (*island.elite, *island.population)}
    info = StepInfo(
        island.generation,
        len(population),
        len(population) - len({each.key for each in population} - known),
        dict(Counter(each.outcome.verdict.name.lower() for each in population)),
        {size: entry.fitness for size, entry in hall.best().items()},
    )
    return replace(island, population=population, elite=elite, hall_of_fame=hall, abandon_threshold=bar), info


def _worst(island: Island, settings: Settings) -> float:
    """Return the fitness that an individual needs to enter the elite."""
    return island.elite[-1].fitness if len(island.elite) == settings.elites else inf


def _bar(island: Island, settings: Settings) -> float:
    """Return the fitness above which nobody enters the elite and few win a tournament.

    It is that of a parent in the middle, or of the last one whose fitness is known.
    """
    known = sorted(each.fitness for each in (*island.elite, *island.population) if isfinite(each.fitness))
    middle = int(_MIDDLE * (len(island.elite) + len(island.population)))
    return max(_worst(island, settings), known[min(middle, len(known) - 1)] if known else inf)


def _bars(hall: HallOfFame, bar: float, most: int) -> list[float]:
    """Return, for every size of a model, the fitness above which nobody needs to know it."""
    last = hall.last()
    return [max(bar, last.get(size, inf)) for size in range(most + 1)]


def select_elite(contenders: Iterable[Individual], count: int, each_once: bool) -> Population:
    """Keep the fittest; ties go to the smaller, then to the structure's text."""
    ordered = sorted(contenders, key=lambda each: (each.fitness, each.size, each.key))
    if each_once:
        ordered = list(unique_structures(ordered))
    return tuple(ordered[:count])
