"""Ray actor that runs islands. It holds the record, warm caches and copies of islands.

Islands are passed and returned by value, so that the loss of an actor costs only time.
"""

from threading import Event
from time import monotonic

import ray

from islands.distribution import read_version
from islands.evolution.epoch import run_epoch
from islands.evolution.island import Island
from islands.evolution.protocol import SearchProblem
from islands.facade.warm_up import warm_up
from islands.processes.settings import freeze_garbage_collector
from islands_service.runtime.packed_epoch import PackedEpoch, pack_epoch, unpack_individuals, unpack_island


class IslandActor:
    """Runs islands of one problem, one epoch per call.

    Parameters
    ----------
    problem : SearchProblem
        From the object store: all actors of a machine share one copy of its record.
    """

    def __init__(self, problem: SearchProblem) -> None:
        self._problem, self._primitives = problem, problem.settings.primitive_table
        self._islands: dict[int, tuple[bytes, Island]] = {}
        self._name = str(ray.get_runtime_context().get_actor_id())

    @ray.method(concurrency_group="watch")
    def confirm_start(self) -> None:
        """Do nothing. The reference to this call resolves when the actor has a CPU and its process runs."""

    def prepare(self, _started: None = None) -> str:
        """Compile kernels, prepare the evaluation, and return the version of islands.

        An error in the problem is raised here.

        Parameters
        ----------
        _started : None
            Result of `confirm_start`, so that this call begins after that one has ended.
        """
        warm_up(lambda _line: None)
        self._evolution = self._problem.open()
        freeze_garbage_collector()
        return read_version()

    @ray.method(concurrency_group="watch")
    def wait_until_killed(self) -> None:
        """Block for ever. The reference to this call fails when the actor dies."""
        Event().wait()

    @ray.method(num_returns=2)
    def advance(self, before: PackedEpoch, *arriving: bytes) -> tuple[PackedEpoch, bytes]:
        """Run an island from its last stop to the next one; return the packed epoch and its emigrants."""
        began = monotonic()
        immigrants = [unpack_individuals(packed, self._primitives) for packed in arriving]
        # A search that ends kills its actors, so no stop function is needed.
        epoch = run_epoch(self._island(before), immigrants, self._evolution, lambda: False)
        assert epoch is not None
        report = pack_epoch(epoch, self._name, self._evolution.memory, monotonic() - began)
        self._islands[report.index] = report.packed, epoch.island
        return report, report.emigrants

    def _island(self, before: PackedEpoch) -> Island:
        """Return an island, unpacked unless it is the one that was packed here last."""
        packed, island = self._islands.pop(before.index, (b"", None))
        if island is not None and packed == before.packed:
            return island
        return unpack_island(before.packed, self._primitives)
