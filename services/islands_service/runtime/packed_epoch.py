"""Epochs of islands as actors return them, with the island and its emigrants pickled.

The driver forwards and keeps the pickled island, and unpickles it only on access. Unpickling an island of
five hundred individuals takes six milliseconds, everything else one.

A pickle contains the name of a primitive, and the table of the problem has its function. Each process then
has one function per primitive, which it compiles once.
"""

import io
import pickle
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any, overload

from islands.evolution.archipelago import Island, StepInfo
from islands.evolution.engine import Caches, IslandEpoch
from islands.evolution.individual import AnyIndividual, AnyPopulation
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive


@dataclass(frozen=True, slots=True)
class PackedEpoch:
    """Result of an island's epoch.

    Attributes
    ----------
    index : int
        Index of the island.
    packed : bytes
        The pickled island.
    emigrants : bytes
        The pickled emigrants.
    steps : tuple of StepInfo
        As in `islands.evolution.engine.IslandEpoch`.
    actor : str
        Id of the actor that ran the epoch.
    caches : mapping
        Memory of the caches of this actor.
    seconds : float
        Time that the actor took.
    """

    index: int
    packed: bytes
    emigrants: bytes
    steps: tuple[StepInfo, ...]
    actor: str = ""
    caches: Caches = field(default_factory=dict)
    seconds: float = 0.0


def pack_epoch(
    epoch: IslandEpoch, actor: str = "", caches: Caches | None = None, seconds: float = 0.0
) -> PackedEpoch:
    """Pickle the island and the emigrants of an epoch and keep the rest."""
    packed, emigrants = _pack(epoch.island), _pack(epoch.emigrants)
    return PackedEpoch(epoch.island.index, packed, emigrants, epoch.steps, actor, caches or {}, seconds)


def sum_caches(parts: Iterable[Caches]) -> Caches:
    """Return the memory of the caches of several actors, by name."""
    totals: dict[str, tuple[int, int]] = {}
    for part in parts:
        for name, (used, limit) in part.items():
            before = totals.get(name, (0, 0))
            totals[name] = before[0] + used, before[1] + limit
    return dict(sorted(totals.items()))


def unpack_island(packed: bytes, primitives: Mapping[str, Primitive]) -> Island:
    """Unpickle an island with the primitives of its problem.

    The bytes come from our own actors, never from an untrusted source.
    """
    island: Island = _Unpickler(packed, primitives).load()
    return island


def unpack_individuals(packed: bytes, primitives: Mapping[str, Primitive]) -> AnyPopulation:
    """Unpickle emigrants, or the best individuals, with the primitives of their problem."""
    individuals: AnyPopulation = _Unpickler(packed, primitives).load()
    return individuals


def pack_best(reports: Sequence[PackedEpoch], primitives: Mapping[str, Primitive]) -> bytes:
    """Return the best individual of every size of islands, pickled."""
    return _pack(tuple(PackedIslands(reports, primitives).find_best()))


def _pack(value: object) -> bytes:
    stream = io.BytesIO()
    _Pickler(stream, pickle.HIGHEST_PROTOCOL).dump(value)
    return stream.getvalue()


class _Pickler(pickle.Pickler):
    def persistent_id(self, value: Any) -> str | None:
        return value.name if isinstance(value, Primitive) else None


class _Unpickler(pickle.Unpickler):
    def __init__(self, packed: bytes, primitives: Mapping[str, Primitive]) -> None:
        super().__init__(io.BytesIO(packed))
        self._primitives = primitives

    def persistent_load(self, name: str) -> Primitive:
        return self._primitives[name]


class LazyIslands(Sequence[Island]):
    """Sequence of islands, each of which is read at its first access; equal to their tuple.

    An iteration over all islands does not keep them: thousands take gigabytes.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._islands: dict[int, Island] = {}

    @abstractmethod
    def _read(self, place: int) -> Island:
        """Return the island at a place from 0 to the size, without it."""

    def __len__(self) -> int:
        return self._size

    def __iter__(self) -> Iterator[Island]:
        return (self._islands.get(place) or self._read(place) for place in range(self._size))

    @overload
    def __getitem__(self, place: int) -> Island: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[Island, ...]: ...
    def __getitem__(self, place: int | slice) -> Island | tuple[Island, ...]:
        if isinstance(place, slice):
            return tuple(self[each] for each in range(*place.indices(len(self))))
        if not -len(self) <= place < len(self):
            raise IndexError(place)
        place %= len(self)
        if place not in self._islands:
            self._islands[place] = self._read(place)
        return self._islands[place]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        return repr(tuple(self))


class PackedIslands(LazyIslands):
    """Islands of packed epochs.

    Parameters
    ----------
    reports : sequence of PackedEpoch
    primitives : mapping
        Primitives of the problem.
    """

    def __init__(self, reports: Sequence[PackedEpoch], primitives: Mapping[str, Primitive]) -> None:
        super().__init__(len(reports))
        self._reports, self._primitives = tuple(reports), primitives

    def find_best(self) -> Iterator[AnyIndividual]:
        """Yield the best individual of every size; see `islands.evolution.archipelago.StoredIslands`.

        Only the islands that have one by their statistics are unpacked, or all if there are no statistics.
        """
        least: dict[int, tuple[float, int]] = {}
        unknown = set[int]()
        for place, report in enumerate(self._reports):
            if not report.steps:
                unknown.add(place)
                continue
            for size, fitness in report.steps[-1].best.items():
                least[size] = min(least.get(size, (inf, place)), (fitness, place))
        for place in sorted(unknown | {place for _, place in least.values()}):
            yield from (self._islands.get(place) or self._read(place)).hall_of_fame.best().values()

    def _read(self, place: int) -> Island:
        return unpack_island(self._reports[place].packed, self._primitives)


def pack_islands(
    islands: Iterable[Island], primitives: Mapping[str, Primitive] = PRIMITIVES
) -> PackedIslands:
    """Pack islands one by one."""
    return PackedIslands([pack_epoch(IslandEpoch(island, (), ())) for island in islands], primitives)
