"""Islands of an archipelago whose packed bytes are in the object store, by region."""

from bisect import bisect_right
from collections.abc import Mapping, Sequence

import ray

from islands.evolution.island import Island
from islands.model.expression import Primitive
from islands_service.runtime.packed_epoch import LazyIslands, PackedIslands


class RegionIslands(LazyIslands):
    """Islands of all regions. A region is fetched at the first access to one of its islands.

    Parameters
    ----------
    starts : sequence of int
        First island of every region.
    size : int
        Number of islands.
    states : sequence of references to tuples of PackedEpoch
        Islands of every region.
    primitives : mapping
        Primitives of the problem.
    """

    def __init__(
        self,
        starts: Sequence[int],
        size: int,
        states: Sequence["ray.ObjectRef"],
        primitives: Mapping[str, Primitive],
    ) -> None:
        super().__init__(size)
        self._starts, self._states, self._primitives = starts, states, primitives
        self._regions: dict[int, PackedIslands] = {}

    def fetch(self) -> None:
        """Fetch all regions: later the cluster may not exist any more."""
        for region in range(len(self._starts)):
            self._get_region(region)

    def _read(self, place: int) -> Island:
        region = bisect_right(self._starts, place) - 1
        return self._get_region(region)[place - self._starts[region]]

    def _get_region(self, region: int) -> PackedIslands:
        if region not in self._regions:
            self._regions[region] = PackedIslands(ray.get(self._states[region]), self._primitives)
        return self._regions[region]
