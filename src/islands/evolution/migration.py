"""Migration between islands: topologies, schedules, and policies that choose migrants and their places."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import isfinite, isqrt
from types import MappingProxyType
from typing import TypeVar

from islands.errors import SettingsError, lookup
from islands.evolution.hall_of_fame import pareto_front
from islands.evolution.individual import AnyPopulation, unique_structures
from islands.evolution.rng import Purpose, Stream

#: In-neighbours of every island.
Sources = list[set[int]]

#: Maximum number of fully connected islands; the number of edges grows with its square.
_MAX_FULLY_CONNECTED = 1_000

#: Maximum number of edges of a random graph; each takes microseconds.
_MAX_RANDOM_EDGES = 50_000

#: Attempted edge switches per edge, which make a regular graph random.
_SWITCHES_PER_EDGE = 5

#: Degree of a random topology without a given degree.
_DEFAULT_DEGREE = 2

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Topology:
    """Sources of every island.

    Attributes
    ----------
    sources : tuple of tuple of int
        For every island, the islands that it receives from, in ascending order, without itself.
    """

    sources: tuple[tuple[int, ...], ...]

    @property
    def in_degree(self) -> int:
        """Largest number of sources of an island."""
        return max(map(len, self.sources), default=0)


@lru_cache
def parse_topology(text: str, islands: int, seed: int) -> Topology:
    """Build a topology.

    Parameters
    ----------
    text : str
        An entry of ``TOPOLOGIES``, with an optional degree (``random-regular:4``), or a list of edges:
        ``0>1,1>2`` sends from island 0 to 1 and from 1 to 2.
    islands : int
        Number of islands.
    seed : int
        Seed of the run, for random topologies.

    Raises
    ------
    SettingsError
        The topology is unknown, or not possible for this number of islands.
    """
    if ">" in text:
        sources = _edges(text, islands)
    else:
        name, colon, degree = text.partition(":")
        build = lookup(TOPOLOGIES, name, "topology")
        if colon and (name not in WITH_DEGREE or not re.fullmatch(r"[1-9]\d?", degree)):
            raise SettingsError(f"topology {text!r}: a degree from 1 to 99 goes with {WITH_DEGREE[0]} alone")
        sources = build(islands, int(degree or _DEFAULT_DEGREE), Stream(seed, 0, 0, Purpose.TOPOLOGY))
    return Topology(tuple(tuple(sorted(each - {island})) for island, each in enumerate(sources)))


def _edges(text: str, islands: int) -> Sources:
    sources: Sources = [set() for _ in range(islands)]
    for edge in text.split(","):
        ends = [end.strip() for end in edge.split(">")]
        if len(ends) != 2 or not all(re.fullmatch(r"\d{1,9}", end) for end in ends):
            raise SettingsError(f"cannot read the edge {edge!r}: write FROM>TO, for example 0>1,1>0")
        source, target = map(int, ends)
        if max(source, target) >= islands or source == target:
            raise SettingsError(
                f"the edge {edge.strip()} does not join two of the islands 0 to {islands - 1}"
            )
        sources[target].add(source)
    return sources


def _isolated(islands: int, _degree: int, _rng: Stream) -> Sources:
    """Connect no islands."""
    return [set() for _ in range(islands)]


def _ring(islands: int, _degree: int, _rng: Stream) -> Sources:
    """Each island sends to the next one."""
    return [{(island - 1) % islands} for island in range(islands)]


def _bidirectional_ring(islands: int, _degree: int, _rng: Stream) -> Sources:
    """Each island sends to the next and to the previous one."""
    return [{(island - 1) % islands, (island + 1) % islands} for island in range(islands)]


def _torus(islands: int, _degree: int, _rng: Stream) -> Sources:
    """Each island has four neighbours on the most square grid; a prime number of islands is a ring."""
    rows = next(rows for rows in range(isqrt(islands), 0, -1) if islands % rows == 0)
    columns = islands // rows
    return [
        {
            ((row + up) % rows) * columns + (column + right) % columns
            for up, right in ((-1, 0), (1, 0), (0, -1), (0, 1))
        }
        for row in range(rows)
        for column in range(columns)
    ]


def _fully_connected(islands: int, _degree: int, _rng: Stream) -> Sources:
    """Each island sends to all others."""
    if islands > _MAX_FULLY_CONNECTED:
        raise SettingsError(
            f"at most {_MAX_FULLY_CONNECTED} islands are fully connected, got {islands}: take a torus"
        )
    return [set(range(islands)) for _ in range(islands)]


def _star(islands: int, _degree: int, _rng: Stream) -> Sources:
    """Island 0 sends to all others and receives from all others."""
    return [set(range(1, islands)), *({0} for _ in range(islands - 1))]


def _random_regular(islands: int, degree: int, rng: Stream) -> Sources:
    """Each island receives from ``degree`` random others and sends to as many.

    The graph starts as a circulant graph. Random pairs of edges a>b, c>d are switched to a>d, c>b until the
    graph is strongly connected.
    """
    if degree >= islands:
        raise SettingsError(f"random-regular:{degree} takes more than {degree} islands, got {islands}")
    if islands * degree > _MAX_RANDOM_EDGES:
        raise SettingsError(
            f"{islands} islands of degree {degree} have more than {_MAX_RANDOM_EDGES} edges: take a smaller "
            "degree"
        )
    sources = [{(island - offset - 1) % islands for offset in range(degree)} for island in range(islands)]
    if degree == 1 or degree == islands - 1:
        return sources
    while True:
        for _ in range(_SWITCHES_PER_EDGE * islands * degree):
            one, other = rng.randrange(islands), rng.randrange(islands)
            from_one, from_other = rng.choice(sorted(sources[one])), rng.choice(sorted(sources[other]))
            if from_one not in {other, *sources[other]} and from_other not in {one, *sources[one]}:
                sources[one] = sources[one] - {from_one} | {from_other}
                sources[other] = sources[other] - {from_other} | {from_one}
        if _connected(sources):
            return sources


def _connected(sources: Sources) -> bool:
    """Return whether all islands are reachable; in a regular graph this implies strong connectivity."""
    reached, frontier = {0}, {0}
    while frontier:
        frontier = set[int]().union(*(sources[island] for island in frontier)) - reached
        reached |= frontier
    return len(reached) == len(sources)


TOPOLOGIES: Mapping[str, Callable[[int, int, Stream], Sources]] = MappingProxyType(
    {
        "isolated": _isolated,
        "ring": _ring,
        "bidirectional-ring": _bidirectional_ring,
        "torus": _torus,
        "fully-connected": _fully_connected,
        "star": _star,
        "random-regular": _random_regular,
    }
)

#: Topologies that take a degree.
WITH_DEGREE = ("random-regular",)


@dataclass(frozen=True, slots=True)
class Schedule:
    """Piecewise constant integer over the generations.

    Attributes
    ----------
    pieces : tuple of (generation, value)
        Each value applies from its generation on; the first piece begins at 0.
    """

    pieces: tuple[tuple[int, int], ...]

    def at(self, generation: int) -> int:
        """Return the value at a generation."""
        return next(value for begin, value in reversed(self.pieces) if begin <= generation)

    def next_stop(self, generation: int) -> int:
        """Return the first stop after a generation; the values are intervals between stops.

        Every generation at which a piece begins is a stop, and intervals are counted from there. Stops do not
        depend on where a run was interrupted.
        """
        begin, every = next(piece for piece in reversed(self.pieces) if piece[0] <= generation)
        stop = begin + ((generation - begin) // every + 1) * every
        return min([stop, *(other for other, _ in self.pieces if other > generation)])

    def stops_at(self, generation: int) -> bool:
        """Return whether a generation is a stop; generation 0 is not."""
        return generation > 0 and self.next_stop(generation - 1) == generation


@lru_cache(typed=True)
def parse_schedule(text: int | str, least: int, what: str) -> Schedule:
    """Parse a schedule.

    Parameters
    ----------
    text : int or str
        ``10`` is constant. ``5,100:20`` is 5, and 20 from generation 100 on.
    least : int
        Smallest valid value.
    what : str
        Name of the schedule in error messages.

    Raises
    ------
    SettingsError
        The text cannot be parsed, its generations do not ascend, or a value is too small.
    """
    first, *others = str(text).split(",")
    pieces = [("0", first), *(part.partition(":")[::2] for part in others)]
    if not all(re.fullmatch(r"\s*\d{1,9}\s*", number) for piece in pieces for number in piece):
        raise SettingsError(
            f"cannot read {what} {text!r}: write a whole number, or 5,100:20 for 5, and 20 from generation "
            "100 on"
        )
    numbers = tuple((int(begin), int(value)) for begin, value in pieces)
    begins = [begin for begin, _ in numbers]
    if any(later <= earlier for earlier, later in pairwise(begins)):
        raise SettingsError(f"{what} {text!r}: its generations ascend, from 1 on")
    if any(value < least for _, value in numbers):
        raise SettingsError(f"{what} is at least {least}, got {text!r}")
    return Schedule(numbers)


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
