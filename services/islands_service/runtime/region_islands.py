"""Islands of an archipelago whose packed bytes are in the object store, by region."""

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError

from islands.evolution.individual import AnyIndividual
from islands.evolution.island import Island
from islands.evolution.protocol import SearchProblem
from islands_service.runtime.errors import ClusterError
from islands_service.runtime.packed_epoch import (
    LazyIslands,
    PackedEpoch,
    PackedIslands,
    pack_best,
    unpack_individuals,
)


def _render(
    problem: SearchProblem, state: tuple[PackedEpoch, ...], function: Callable[[Island], bytes]
) -> list[bytes]:
    return [*map(function, PackedIslands(state, problem.settings.primitive_table))]


def _pack_best(problem: SearchProblem, state: tuple[PackedEpoch, ...]) -> bytes:
    return pack_best(state, problem.settings.primitive_table)


#: Ray prefers the machine that has the islands. Its CPUs are busy with islands, so that no CPU is requested.
_TASK = ray.remote(num_cpus=0, max_retries=3)(_render)
_BEST_TASK = ray.remote(num_cpus=0, max_retries=3)(_pack_best)


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
    problem : SearchProblem
    shared : reference to SearchProblem
        The problem in the object store.

    Raises
    ------
    ClusterError
        Later, at an access: the islands of a region were lost with their machine.
    """

    def __init__(
        self,
        starts: Sequence[int],
        size: int,
        states: Sequence["ray.ObjectRef"],
        problem: SearchProblem,
        shared: "ray.ObjectRef[SearchProblem]",
    ) -> None:
        super().__init__(size)
        self._starts, self._states = starts, states
        self._primitives, self._shared = problem.settings.primitive_table, shared
        self._regions: dict[int, PackedIslands] = {}

    def fetch(self) -> None:
        """Fetch all regions: later the cluster may not exist any more."""
        for region in range(len(self._starts)):
            self._get_region(region)

    def render(self, function: Callable[[Island], bytes]) -> Iterator[bytes]:
        """Yield the bytes that a function returns for each island; see `Archipelago.render`.

        A region that was not fetched is rendered by a task of Ray, and all of them at the same time.

        Raises
        ------
        ClusterError
            The islands of a region were lost with their machine.
        """
        tasks = {
            region: _TASK.remote(self._shared, state, function)
            for region, state in enumerate(self._states)
            if region not in self._regions
        }
        try:
            for region in range(len(self._states)):
                if region in tasks:
                    yield from _get(tasks[region])
                    del tasks[region]
                else:
                    yield from map(function, self._regions[region])
        finally:
            for reference in tasks.values():
                ray.cancel(reference, force=True)

    def find_best(self) -> Iterator[AnyIndividual]:
        """Yield the best individual of every size of every region.

        Tasks of Ray find them, all at the same time.

        Raises
        ------
        ClusterError
            The islands of a region were lost with their machine.
        """
        tasks = [_BEST_TASK.remote(self._shared, state) for state in self._states]
        try:
            for task in tasks:
                yield from unpack_individuals(_get(task), self._primitives)
        finally:
            for task in tasks:
                ray.cancel(task, force=True)

    def _read(self, place: int) -> Island:
        region = bisect_right(self._starts, place) - 1
        return self._get_region(region)[place - self._starts[region]]

    def _get_region(self, region: int) -> PackedIslands:
        if region not in self._regions:
            self._regions[region] = PackedIslands(_get(self._states[region]), self._primitives)
        return self._regions[region]


def _get(reference: "ray.ObjectRef") -> Any:
    """Return a value of the object store."""
    try:
        return ray.get(reference)
    except RayError as error:
        if isinstance(error, RayTaskError) and not isinstance(error.cause, RayError):
            raise error.cause from error
        raise ClusterError(f"islands were lost, and the search cannot continue: {error}") from error
