"""The actor that carries islands: it holds the record, warm caches, and nothing that is not a copy.

An island enters as a value and leaves as a value. Who loses an actor loses time.
"""

from importlib.metadata import version
from threading import Event

import ray

from islands.evolution.epoch import run_epoch
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.gp.individual import Population
from islands.evolution.island import Island
from islands.evolution.problem import Problem
from islands.facade.warm_up import warm_up
from islands_service.runtime.packed_epoch import PackedEpoch, pack_epoch, unpack_island


class IslandActor:
    """Carries islands of one problem, one epoch a call.

    Parameters
    ----------
    problem : Problem
        From the object store: all actors of a machine read one copy of its record.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._islands: dict[int, tuple[bytes, Island]] = {}
        self._name = str(ray.get_runtime_context().get_actor_id())

    def prepare(self) -> str:
        """Make what the epochs need; what is wrong with the problem is raised here. Return our version."""
        warm_up(lambda _line: None)
        self._evaluator = Evaluator(self._problem.record, self._problem.settings)
        return version("islands")

    @ray.method(concurrency_group="watch")
    def wait_until_killed(self) -> None:
        """Never return: who waits for this learns of the actor's death."""
        Event().wait()

    @ray.method(num_returns=2)
    def advance(self, before: PackedEpoch, *arriving: Population) -> tuple[PackedEpoch, Population]:
        """Carry an island from where it stood to its next stop; return that, and who emigrates."""
        # Nobody tells it to stop: a search that ends kills its actors, and misses nothing.
        epoch = run_epoch(self._island(before), arriving, self._evaluator, self._problem, lambda: False)
        assert epoch is not None
        report = pack_epoch(epoch, self._name, self._evaluator.memory)
        self._islands[report.index] = report.packed, epoch.island
        return report, epoch.emigrants

    def _island(self, before: PackedEpoch) -> Island:
        """Unpack an island, unless it is the one that was packed here last."""
        packed, island = self._islands.pop(before.index, (b"", None))
        return island if island is not None and packed == before.packed else unpack_island(before)
