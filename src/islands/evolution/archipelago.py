"""Islands, and the archipelago: the state of all islands at one generation."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Protocol, runtime_checkable

from islands.evolution.hall_of_fame import HallOfFame, merge, pareto_front
from islands.evolution.individual import AnyIndividual, AnyPopulation


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
    population : sequence of AnyIndividual
        Evaluated offspring of the last generation: a tuple or `Offspring`.
    elite : tuple of AnyIndividual
        Best individuals so far, fittest first.
    hall_of_fame : HallOfFame
    abandon_threshold : float
        Lower bound on the fitness of individuals whose evaluation was abandoned.
    """

    index: int
    seed: int
    generation: int
    population: Sequence[AnyIndividual]
    elite: AnyPopulation
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


@runtime_checkable
class RemoteIslands(Protocol):
    """Interface of sequences of islands some of which are in other processes."""

    def render(self, function: Callable[[Island], bytes]) -> Iterator[bytes]:
        """Yield the bytes that a function returns for each island, and call it where the islands are."""
        ...


@runtime_checkable
class StoredIslands(Protocol):
    """Interface of sequences of islands that are expensive to read, and know where their best models are."""

    def find_best(self) -> Iterator[AnyIndividual]:
        """Yield, among others, the best individual of every size; of equal ones that of the first island."""
        ...


@dataclass(frozen=True, slots=True)
class Archipelago:
    """Islands at the same generation.

    Attributes
    ----------
    islands : sequence of Island
        In ascending order of their index.
    """

    islands: Sequence[Island] = ()

    @property
    def generation(self) -> int:
        """Generations completed by every island; -1 before the first population."""
        return self.islands[0].generation if self.islands else -1

    @property
    def hall_of_fame(self) -> HallOfFame:
        """Merged halls of fame of all islands."""
        return merge(island.hall_of_fame for island in self.islands)

    def find_front(self) -> AnyPopulation:
        """Return the Pareto front of error and size, smallest first.

        Islands in other processes are not fetched.
        """
        if isinstance(self.islands, StoredIslands):
            return pareto_front(self.islands.find_best())
        return pareto_front(entry for island in self.islands for entry in island.hall_of_fame.best().values())

    def render(self, function: Callable[[Island], bytes]) -> Iterator[bytes]:
        """Yield the bytes that a function returns for each island, in order.

        Islands in other processes are not fetched.

        Parameters
        ----------
        function : callable
            Can be pickled.
        """
        if isinstance(self.islands, RemoteIslands):
            return self.islands.render(function)
        return map(function, self.islands)


def empty_archipelago(islands: int, seed: int) -> Archipelago:
    """Return an archipelago of empty islands (generation -1)."""
    return Archipelago(tuple(Island(index, seed, -1, (), (), HallOfFame()) for index in range(islands)))
