"""Epoch of one island: immigration, generations up to the next migration, emigration.

Immigrants enter at the beginning of an epoch. They are the emigrants that the source islands selected at the
end of the previous epoch, so an island waits only for its sources.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from islands.evolution.individual import AnyPopulation, unique_structures
from islands.evolution.island import Island, StepInfo
from islands.evolution.migration.policies import REPLACEMENT_POLICIES, SELECTION_POLICIES
from islands.evolution.protocol import Evolution
from islands.evolution.rng import Purpose, Stream
from islands.evolution.settings import Settings


@dataclass(frozen=True, slots=True)
class IslandEpoch:
    """Result of an epoch of one island.

    Attributes
    ----------
    island : Island
    emigrants : tuple of Individual
        Copies of individuals that its neighbours receive at the beginning of the next epoch.
    steps : tuple of StepInfo
        One entry per generation of the epoch.
    """

    island: Island
    emigrants: AnyPopulation
    steps: tuple[StepInfo, ...]


def run_epoch(
    island: Island,
    arriving: Sequence[AnyPopulation],
    evolution: Evolution,
    stop: Callable[[], bool],
) -> IslandEpoch | None:
    """Run an island up to the next migration.

    Parameters
    ----------
    arriving : sequence of populations
        Emigrants of each source, in ascending order of the sources' index; see `select_migrants`.
    stop : callable
        Called before every generation.

    Returns
    -------
    IslandEpoch or None
        None if ``stop`` returned true. The generations of the unfinished epoch are discarded.
    """
    settings = evolution.problem.settings_of(island.index)
    last = next_stop(island.generation, settings)
    island = receive_migrants(island, arriving, evolution)
    steps = []
    while island.generation < last:
        if stop():
            return None
        if island.generation < 0:
            island, info = evolution.first_generation(island.index, island.seed)
        else:
            island, info = evolution.step(island)
        steps.append(info)
    return IslandEpoch(island, select_migrants(island, settings), tuple(steps))


def next_stop(generation: int, settings: Settings) -> int:
    """Return the end of the epoch that begins at a generation; the first population is a separate epoch."""
    return 0 if generation < 0 else min(settings.generations, settings.stops.next_stop(generation))


def select_migrants(island: Island, settings: Settings) -> AnyPopulation:
    """Return copies of the emigrants of an island; none if no migration is scheduled at its generation.

    Every emigrant has a known fitness: abandoned individuals are not selected.
    """
    if not settings.stops.stops_at(island.generation):
        return ()
    count = settings.leaving.at(island.generation)
    rng = Stream(island.seed, island.index, island.generation, Purpose.EMIGRATION)
    return SELECTION_POLICIES[settings.emigrants](island.elite, count, rng)


def receive_migrants(island: Island, arriving: Sequence[AnyPopulation], evolution: Evolution) -> Island:
    """Return the island after immigration.

    Immigrants replace individuals chosen by the replacement policy and compete for the elite. The population
    keeps its size, and the elite never shrinks. Models that are already in the elite are ignored.
    """
    known = {each.key for each in island.elite}
    candidates = [each for each in unique_structures(chain(*arriving)) if each.key not in known]
    immigrants = candidates[: len(island.population)]
    if not immigrants:
        return island
    rng = Stream(island.seed, island.index, island.generation, Purpose.IMMIGRATION)
    places = REPLACEMENT_POLICIES[evolution.problem.settings_of(island.index).replaced](
        len(island.population),
        lambda: evolution.complete_fitness(island.population),
        len(immigrants),
        rng,
    )
    population = list(island.population)
    for place, each in zip(places, immigrants, strict=True):
        population[place] = each
    elite = evolution.select_elite((*island.elite, *immigrants), island.index)
    return replace(island, population=tuple(population), elite=elite)
