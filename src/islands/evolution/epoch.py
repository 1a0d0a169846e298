"""An island's epoch: who arrives, the steps to the next stop of the schedule, who leaves.

Migration happens at the beginning of an epoch, from the values that the islands had at the end of the one
before. So an island waits for those that it receives from, and for nobody else.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.gp.individual import Population, unique_structures
from islands.evolution.gp.rng import Purpose, Stream
from islands.evolution.island import Island, StepInfo, first_generation, select_elite, step
from islands.evolution.migration.policies import REPLACEMENT_POLICIES, SELECTION_POLICIES
from islands.evolution.problem import Problem
from islands.evolution.settings import Settings
from islands.simulation.outcome import Status


@dataclass(frozen=True, slots=True)
class IslandEpoch:
    """What an island brings back from an epoch.

    Attributes
    ----------
    island : Island
    emigrants : tuple of Individual
        Copies of those who leave it for the next epoch of its neighbours.
    steps : tuple of StepInfo
        One for every generation of the epoch.
    """

    island: Island
    emigrants: Population
    steps: tuple[StepInfo, ...]


def run_epoch(
    island: Island,
    arriving: Sequence[Population],
    evaluator: Evaluator,
    problem: Problem,
    stop: Callable[[], bool],
) -> IslandEpoch | None:
    """Carry an island to the next stop.

    Parameters
    ----------
    arriving : sequence of populations
        The `select_migrants` of every source, in the order of the sources' index.
    stop : callable
        Asked before every generation.

    Returns
    -------
    IslandEpoch or None
        None where it was told to stop: what has been done of the epoch is lost.
    """
    settings = problem.settings_of(island.index)
    last = next_stop(island.generation, settings)
    island = receive_migrants(island, arriving, evaluator, settings)
    steps = []
    while island.generation < last:
        if stop():
            return None
        if island.generation < 0:
            island, info = first_generation(island.index, island.seed, evaluator, problem.seeds, settings)
        else:
            island, info = step(island, evaluator, problem.pool, settings)
        steps.append(info)
    return IslandEpoch(island, select_migrants(island, settings), tuple(steps))


def next_stop(generation: int, settings: Settings) -> int:
    """Return where the epoch ends that begins at a generation; the first population is one of its own."""
    return 0 if generation < 0 else min(settings.generations, settings.stops.next_stop(generation))


def select_migrants(island: Island, settings: Settings) -> Population:
    """Return copies of those who leave an island; nobody does but at a stop of the schedule.

    All have a fitness that is known: whoever was abandoned stays.
    """
    if not settings.stops.stops_at(island.generation):
        return ()
    count = settings.leaving.at(island.generation)
    draw = Stream(island.seed, island.index, island.generation, Purpose.EMIGRATION)
    return SELECTION_POLICIES[settings.emigrants](island.elite, count, draw)


def receive_migrants(
    island: Island, arriving: Sequence[Population], evaluator: Evaluator, settings: Settings
) -> Island:
    """Return the island after an arrival; its population keeps its size, and the elite never shrinks.

    Who arrives takes somebody's place in the population, and contends for the elite. A model that the elite
    has already does not arrive again.
    """
    known = {each.key for each in island.elite}
    fresh = [each for each in unique_structures(chain(*arriving)) if each.key not in known]
    immigrants = fresh[: len(island.population)]
    if not immigrants:
        return island
    draw = Stream(island.seed, island.index, island.generation, Purpose.IMMIGRATION)
    places = REPLACEMENT_POLICIES[settings.replaced](
        len(island.population), lambda: _fitness(island.population, evaluator), len(immigrants), draw
    )
    population = list(island.population)
    for place, each in zip(places, immigrants, strict=True):
        population[place] = each
    elite = select_elite((*island.elite, *immigrants), settings.elites, settings.distinct)
    return replace(island, population=tuple(population), elite=elite)


def _fitness(population: Population, evaluator: Evaluator) -> list[float]:
    """Return everybody's fitness; who was abandoned is evaluated to the end."""
    fitness = [each.fitness for each in population]
    places = [place for place, each in enumerate(population) if each.outcome.verdict is Status.ABANDONED]
    for place, each in zip(places, evaluator.settled([population[place] for place in places]), strict=True):
        fitness[place] = each.fitness
    return fitness
