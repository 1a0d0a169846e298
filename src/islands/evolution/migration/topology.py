"""Topologies: from whom an island receives. A new one is an entry of ``TOPOLOGIES``.

The words are those of Cantu-Paz, Efficient and Accurate Parallel Genetic Algorithms (2000), chapter 6.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import isqrt
from types import MappingProxyType

from islands.errors import SettingsError, lookup
from islands.evolution.gp.rng import Purpose, Stream

#: In-neighbours of every island, any order.
Sources = list[set[int]]

#: Islands that may all be connected with each other: the edges are as many as their square.
_FULLY = 1_000

#: Edges of all islands together that may be drawn: each takes microseconds.
_RANDOM = 50_000

#: Edges that are switched to make a regular graph random, for each edge that it has.
_SWITCHES = 5

#: Of a random topology that does not say.
_DEGREE = 2


@dataclass(frozen=True, slots=True)
class Topology:
    """Who receives from whom.

    Attributes
    ----------
    sources : tuple of tuple of int
        For every island the islands it receives from, ascending; never itself.
    """

    sources: tuple[tuple[int, ...], ...]

    @property
    def in_degree(self) -> int:
        """The most islands that one receives from."""
        return max(map(len, self.sources), default=0)


@lru_cache
def topology(text: str, islands: int, seed: int) -> Topology:
    """Lay out a topology.

    Parameters
    ----------
    text : str
        An entry of ``TOPOLOGIES``, with a degree where it takes one (``random-regular:4``), or a list of
        edges: ``0>1,1>2`` sends from island 0 to 1 and from 1 to 2.
    seed : int
        Of the run; the random ones differ with it.

    Raises
    ------
    SettingsError
        There is none of that name, or it cannot be laid out over so many islands.
    """
    if ">" in text:
        sources = _edges(text, islands)
    else:
        name, colon, degree = text.partition(":")
        build = lookup(TOPOLOGIES, name, "topology")
        if colon and (name not in WITH_DEGREE or not re.fullmatch(r"[1-9]\d?", degree)):
            raise SettingsError(f"topology {text!r}: a degree from 1 to 99 goes with {WITH_DEGREE[0]} alone")
        sources = build(islands, int(degree or _DEGREE), Stream(seed, 0, 0, Purpose.TOPOLOGY))
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


def _isolated(islands: int, _degree: int, _draw: Stream) -> Sources:
    """Connect no islands."""
    return [set() for _ in range(islands)]


def _ring(islands: int, _degree: int, _draw: Stream) -> Sources:
    """Let each island send to the next one."""
    return [{(island - 1) % islands} for island in range(islands)]


def _bidirectional_ring(islands: int, _degree: int, _draw: Stream) -> Sources:
    """Let each island send to the next one and to the previous one."""
    return [{(island - 1) % islands, (island + 1) % islands} for island in range(islands)]


def _torus(islands: int, _degree: int, _draw: Stream) -> Sources:
    """Have four neighbours on the grid nearest to a square; a prime number of islands is a ring."""
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


def _fully_connected(islands: int, _degree: int, _draw: Stream) -> Sources:
    """Let each island send to all others."""
    if islands > _FULLY:
        raise SettingsError(f"at most {_FULLY} islands are fully connected, got {islands}: take a torus")
    return [set(range(islands)) for _ in range(islands)]


def _star(islands: int, _degree: int, _draw: Stream) -> Sources:
    """Let island 0 give to all and receive from all."""
    return [set(range(1, islands)), *({0} for _ in range(islands - 1))]


def _random_regular(islands: int, degree: int, draw: Stream) -> Sources:
    """Let every island receive from ``degree`` others and give to as many.

    It begins as a circulant graph, whose edges a>b, c>d are switched to a>d, c>b at random, and goes on
    until every island can reach every other one.
    """
    if degree >= islands:
        raise SettingsError(f"random-regular:{degree} takes more than {degree} islands, got {islands}")
    if islands * degree > _RANDOM:
        raise SettingsError(
            f"{islands} islands of degree {degree} have more than {_RANDOM} edges to draw: take a smaller one"
        )
    sources = [{(island - offset - 1) % islands for offset in range(degree)} for island in range(islands)]
    if degree == 1 or degree == islands - 1:
        return sources
    while True:
        for _ in range(_SWITCHES * islands * degree):
            one, other = draw.randrange(islands), draw.randrange(islands)
            gift, counter = draw.choice(sorted(sources[one])), draw.choice(sorted(sources[other]))
            if gift not in {other, *sources[other]} and counter not in {one, *sources[one]}:
                sources[one] = sources[one] - {gift} | {counter}
                sources[other] = sources[other] - {counter} | {gift}
        if _connected(sources):
            return sources


def _connected(sources: Sources) -> bool:
    """Tell whether all can be reached; in a graph as regular as this one direction implies the other."""
    reached, edge = {0}, {0}
    while edge:
        edge = set[int]().union(*(sources[island] for island in edge)) - reached
        reached |= edge
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

#: Those that take a degree.
WITH_DEGREE = ("random-regular",)
