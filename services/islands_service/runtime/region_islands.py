"""Islands of an archipelago whose packed bytes are in the object store, by region."""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from typing import overload

import ray

from islands.evolution.island import Island
from islands.model.expression import Primitive
from islands_service.runtime.packed_epoch import PackedIslands


class RegionIslands(Sequence[Island]):
    """Sequence of the islands of all regions. A region is fetched at the first access; equal to the tuple.

    Parameters
    ----------
    starts : sequence of int
        First island of every region.
    islands : int
        Number of islands.
    states : sequence of references to tuples of PackedEpoch
        Islands of every region.
    primitives : mapping
        Primitives of the problem.
    """

    def __init__(
        self,
        starts: Sequence[int],
        islands: int,
        states: Sequence["ray.ObjectRef"],
        primitives: Mapping[str, Primitive],
    ) -> None:
        self._starts, self._size, self._states, self._primitives = starts, islands, states, primitives
        self._regions: dict[int, PackedIslands] = {}

    def fetch(self) -> None:
        """Fetch all regions: later the cluster may not exist any more."""
        for region in range(len(self._starts)):
            self._get_region(region)

    def __len__(self) -> int:
        return self._size

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
        region = bisect_right(self._starts, place) - 1
        return self._get_region(region)[place - self._starts[region]]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        return repr(tuple(self))

    def _get_region(self, region: int) -> PackedIslands:
        if region not in self._regions:
            self._regions[region] = PackedIslands(ray.get(self._states[region]), self._primitives)
        return self._regions[region]
