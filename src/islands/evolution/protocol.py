"""Interfaces of the search for models of one class: its problem, and the steps of its islands."""

from collections.abc import Mapping, Sequence
from typing import Protocol

from islands.evolution.individual import AnyIndividual
from islands.evolution.island import Island, StepInfo
from islands.evolution.settings import Settings
from islands.models.protocol import DynamicModel
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
