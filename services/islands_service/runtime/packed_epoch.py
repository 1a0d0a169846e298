"""Epochs of islands as actors return them, with the island pickled.

The driver forwards and keeps the pickled island, and unpickles it only on access. Unpickling an island of
five hundred individuals takes six milliseconds, everything else one.
"""

import pickle
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import overload

from islands.evolution.engine import Caches
from islands.evolution.epoch import IslandEpoch
from islands.evolution.gp.individual import Population
from islands.evolution.island import Island, StepInfo


@dataclass(frozen=True, slots=True)
class PackedEpoch:
    """Result of an island's epoch.

    Attributes
    ----------
    index : int
        Index of the island.
    packed : bytes
        The pickled island.
    emigrants : tuple of Individual
    steps : tuple of StepInfo
        As in `islands.evolution.epoch.IslandEpoch`.
    actor : str
        Id of the actor that ran the epoch.
    caches : mapping
        Memory of the caches of this actor.
    """

    index: int
    packed: bytes
    emigrants: Population
    steps: tuple[StepInfo, ...]
    actor: str = ""
    caches: Caches = field(default_factory=dict)


def pack_epoch(epoch: IslandEpoch, actor: str = "", caches: Caches | None = None) -> PackedEpoch:
    """Pickle the island of an epoch and keep the rest."""
    packed = pickle.dumps(epoch.island, pickle.HIGHEST_PROTOCOL)
    return PackedEpoch(epoch.island.index, packed, epoch.emigrants, epoch.steps, actor, caches or {})


def unpack_island(report: PackedEpoch) -> Island:
    """Unpickle the island of an epoch. The bytes come from our own actors, never from an untrusted source."""
    island: Island = pickle.loads(report.packed)
    return island


class PackedIslands(Sequence[Island]):
    """Sequence of the islands of packed epochs, each unpickled at its first access; equal to their tuple."""

    def __init__(self, reports: Sequence[PackedEpoch]) -> None:
        self._reports = tuple(reports)
        self._islands: dict[int, Island] = {}

    def __len__(self) -> int:
        return len(self._reports)

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
            self._islands[place] = unpack_island(self._reports[place])
        return self._islands[place]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        return repr(tuple(self))
