"""Reports: what an actor says of an island's epoch.

The island itself is packed. The coordinator passes it on and keeps it, and unpacks it where somebody looks:
an island of five hundred takes it six milliseconds, and everything else one.
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
    """What is known of an island at the end of an epoch.

    Attributes
    ----------
    index : int
        The island's.
    packed : bytes
        The island.
    emigrants : tuple of Individual
    steps : tuple of StepInfo
        As in `islands.evolution.epoch.IslandEpoch`.
    actor : str
        Whose caches these are.
    caches : mapping
        What the caches of the actor take.
    """

    index: int
    packed: bytes
    emigrants: Population
    steps: tuple[StepInfo, ...]
    actor: str = ""
    caches: Caches = field(default_factory=dict)


def pack_epoch(epoch: IslandEpoch, actor: str = "", caches: Caches | None = None) -> PackedEpoch:
    """Pack what an epoch brought."""
    packed = pickle.dumps(epoch.island, pickle.HIGHEST_PROTOCOL)
    return PackedEpoch(epoch.island.index, packed, epoch.emigrants, epoch.steps, actor, caches or {})


def unpack_island(report: PackedEpoch) -> Island:
    """Return a report's island. It comes from an actor of our own, never from a stranger."""
    island: Island = pickle.loads(report.packed)
    return island


class PackedIslands(Sequence[Island]):
    """The islands of reports, each unpacked when it is first looked at; equal to the tuple of them."""

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
