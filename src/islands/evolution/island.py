"""State of one island, and the statistics of a generation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

from islands.evolution.hall_of_fame import HallOfFame
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
