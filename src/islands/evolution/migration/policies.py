"""Migration policies: selection of emigrants, and replacement by immigrants.

A policy is an entry of ``SELECTION_POLICIES`` or of ``REPLACEMENT_POLICIES``.
"""

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from types import MappingProxyType
from typing import TypeVar

from islands.evolution.hall_of_fame import pareto_front
from islands.evolution.individual import AnyPopulation, unique_structures
from islands.evolution.rng import Stream

T = TypeVar("T")


def _best(elite: AnyPopulation, count: int, _rng: Stream) -> AnyPopulation:
    """Select the best of the elite, each structure once."""
    return _unique_structures(elite)[:count]


def _random(elite: AnyPopulation, count: int, rng: Stream) -> AnyPopulation:
    """Select from the elite at random, each structure once."""
    return _sample(_unique_structures(elite), count, rng)


def _front(elite: AnyPopulation, count: int, rng: Stream) -> AnyPopulation:
    """Select at random from the Pareto front of error and size, so that small models migrate, too."""
    return _sample(pareto_front(_unique_structures(elite)), count, rng)


def _unique_structures(elite: AnyPopulation) -> AnyPopulation:
    return unique_structures(each for each in elite if isfinite(each.fitness))


def _worst(_size: int, fitness: Callable[[], Sequence[float]], count: int, _rng: Stream) -> tuple[int, ...]:
    """Replace the individuals with the worst fitness, the first ones if equal."""
    known = fitness()
    return tuple(sorted(range(len(known)), key=lambda place: -known[place])[:count])


def _random_places(
    size: int, _fitness: Callable[[], Sequence[float]], count: int, rng: Stream
) -> tuple[int, ...]:
    """Replace random individuals."""
    return _sample(range(size), count, rng)


def _sample(pool: Sequence[T], count: int, rng: Stream) -> tuple[T, ...]:
    remaining = list(pool)
    return tuple(remaining.pop(rng.randrange(len(remaining))) for _ in range(min(count, len(remaining))))


#: Selects emigrants from: the elite, the maximum number, the random stream.
SELECTION_POLICIES: Mapping[str, Callable[[AnyPopulation, int, Stream], AnyPopulation]] = MappingProxyType(
    {"best": _best, "random": _random, "front": _front}
)

#: Selects positions to replace from: the population's size, a function that computes its fitness (expensive,
#: called only if needed), the number of positions, the random stream.
REPLACEMENT_POLICIES: Mapping[
    str, Callable[[int, Callable[[], Sequence[float]], int, Stream], tuple[int, ...]]
] = MappingProxyType({"worst": _worst, "random": _random_places})
