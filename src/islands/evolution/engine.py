"""Engines: they run the epochs of a search. All engines yield the same archipelagos, bit for bit."""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Protocol

from islands.available_cpus import count_cpus
from islands.evolution.archipelago import Archipelago, Island, StepInfo
from islands.evolution.individual import AnyIndividual, AnyPopulation, unique_structures
from islands.evolution.migration import REPLACEMENT_POLICIES, SELECTION_POLICIES, Topology, parse_topology
from islands.evolution.rng import Purpose, Stream
from islands.evolution.settings import Settings
from islands.models.protocol import DynamicModel
from islands.progress import Stop
from islands.records.dataset import Dataset

#: Bytes in use and byte limit of each cache, by name.
Caches = Mapping[str, tuple[int, int]]


class Evolution(Protocol):
    """Interface of the steps of islands in one process, with the caches of the evaluation.

    Contract: the steps depend only on the problem and on the island, never on earlier calls.
    """

    @property
    def problem(self) -> "SearchProblem":
        """Problem of the search."""
        ...

    @property
    def memory(self) -> Caches:
        """Memory of the caches."""
        ...

    def first_generation(self, index: int, seed: int) -> tuple[Island, StepInfo]:
        """Draw and evaluate the first population of an island."""
        ...

    def step(self, island: Island) -> tuple[Island, StepInfo]:
        """Breed and evaluate one generation, and update elite and hall of fame."""
        ...

    def complete_fitness(self, population: Sequence[AnyIndividual]) -> list[float]:
        """Return the fitness of each individual; abandoned individuals are evaluated completely."""
        ...

    def select_elite(self, contenders: Sequence[AnyIndividual], island: int) -> tuple[AnyIndividual, ...]:
        """Return the elite of an island among contenders, fittest first."""
        ...


class SearchProblem(Protocol):
    """Interface of search problems, which all islands share. A problem can be pickled."""

    @property
    def record(self) -> Dataset:
        """Estimation data without missing values."""
        ...

    @property
    def settings(self) -> Settings:
        """Settings of the search."""
        ...

    def settings_of(self, island: int, /) -> Settings:
        """Return the settings of an island."""
        ...

    @property
    def offsets(self) -> tuple[float, ...]:
        """Constants that were subtracted from the output and from every input; empty if there were none."""
        ...

    def make_model(self, individual: AnyIndividual, /) -> DynamicModel:
        """Return the model of an individual, before the final estimation."""
        ...

    def open(self, threads: int = 1) -> Evolution:
        """Return the steps of the islands in this process.

        Parameters
        ----------
        threads : int
            Largest number of threads that evaluate the individuals of a generation.
        """
        ...


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
    known = {individual.key for individual in island.elite}
    candidates = [
        individual for individual in unique_structures(chain(*arriving)) if individual.key not in known
    ]
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
    for place, immigrant in zip(places, immigrants, strict=True):
        population[place] = immigrant
    elite = evolution.select_elite((*island.elite, *immigrants), island.index)
    return replace(island, population=tuple(population), elite=elite)


@dataclass(frozen=True, slots=True)
class ArchipelagoEpoch:
    """Archipelago at the end of an epoch, with the statistics of the epoch.

    Attributes
    ----------
    archipelago : Archipelago
    steps : tuple of tuple of StepInfo
        For every island, one entry per generation since the previous epoch.
    caches : mapping
        Memory of the caches, summed over all evaluators.
    """

    archipelago: Archipelago
    steps: tuple[tuple[StepInfo, ...], ...]
    caches: Caches = field(default_factory=dict)


class Engine(Protocol):
    """Interface of engines, which run the epochs of a search.

    Contract: the archipelagos depend only on the problem and on the first archipelago. An engine that starts
    from an archipelago that it yielded earlier continues with the same archipelagos.
    """

    def run(self, problem: SearchProblem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Yield every epoch after ``start``, up to the settings' last generation.

        Parameters
        ----------
        start : Archipelago
            Archipelago to continue from; `empty_archipelago` starts a new search.
        stop : callable
            Called frequently. Once it returns true, no further epoch is yielded.
        """
        ...


class SerialEngine:
    """Engine that runs the islands one after the other in this process, with one set of caches."""

    def run(self, problem: SearchProblem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Yield every epoch after ``start``."""
        evolution = problem.open(count_cpus())
        sources = make_topology(problem, start).sources
        archipelago = start
        leaving = [select_migrants(island, problem.settings_of(island.index)) for island in start.islands]
        while archipelago.generation < problem.settings.generations:
            epochs: list[IslandEpoch] = []
            for island in archipelago.islands:
                arriving = [leaving[source] for source in sources[island.index]]
                epoch = run_epoch(island, arriving, evolution, stop)
                if epoch is None:
                    return
                epochs.append(epoch)
            archipelago = Archipelago(tuple(epoch.island for epoch in epochs))
            leaving = [epoch.emigrants for epoch in epochs]
            yield ArchipelagoEpoch(archipelago, tuple(epoch.steps for epoch in epochs), evolution.memory)


def make_topology(problem: SearchProblem, archipelago: Archipelago) -> Topology:
    """Return the topology for the number of islands and the seed of an archipelago."""
    islands = archipelago.islands
    return parse_topology(problem.settings.topology, len(islands), islands[0].seed)
