"""Migration policies: who leaves an island, and whose place they take on another.

A new one is an entry of ``SELECTION_POLICIES`` or of ``REPLACEMENT_POLICIES``.
"""

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from types import MappingProxyType
from typing import TypeVar

from islands.evolution.gp.individual import Population, unique_structures
from islands.evolution.gp.rng import Stream
from islands.evolution.hall_of_fame import pareto_front

T = TypeVar("T")


def _best(elite: Population, count: int, _draw: Stream) -> Population:
    """Take the first of the elite, each structure once."""
    return _structures(elite)[:count]


def _random(elite: Population, count: int, draw: Stream) -> Population:
    """Take anyone of the elite, each structure once."""
    return _drawn(_structures(elite), count, draw)


def _front(elite: Population, count: int, draw: Stream) -> Population:
    """Take anyone of the elite's Pareto front of error and size: small models travel too."""
    return _drawn(pareto_front(_structures(elite)), count, draw)


def _structures(elite: Population) -> Population:
    return unique_structures(each for each in elite if isfinite(each.fitness))


def _worst(_size: int, fitness: Callable[[], Sequence[float]], count: int, _draw: Stream) -> tuple[int, ...]:
    """Take the least fit; of equals the first."""
    known = fitness()
    return tuple(sorted(range(len(known)), key=lambda place: -known[place])[:count])


def _anyone(size: int, _fitness: Callable[[], Sequence[float]], count: int, draw: Stream) -> tuple[int, ...]:
    """Take anyone."""
    return _drawn(range(size), count, draw)


def _drawn(pool: Sequence[T], count: int, draw: Stream) -> tuple[T, ...]:
    left = list(pool)
    return tuple(left.pop(draw.randrange(len(left))) for _ in range(min(count, len(left))))


#: From the elite, how many at the most, and draws: those of whom copies leave.
SELECTION_POLICIES: Mapping[str, Callable[[Population, int, Stream], Population]] = MappingProxyType(
    {"best": _best, "random": _random, "front": _front}
)

#: From the population's size, its fitness for whoever asks (it takes evaluations), how many, and draws: the
#: places that are taken.
REPLACEMENT_POLICIES: Mapping[
    str, Callable[[int, Callable[[], Sequence[float]], int, Stream], tuple[int, ...]]
] = MappingProxyType({"worst": _worst, "random": _anyone})
