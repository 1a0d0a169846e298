"""Engines: how epochs are carried out. Every engine yields the same archipelagos, bit for bit."""

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from islands.evolution.archipelago import Archipelago
from islands.evolution.epoch import IslandEpoch, run_epoch, select_migrants
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.island import StepInfo
from islands.evolution.migration.topology import Topology, topology
from islands.evolution.problem import Problem

#: Answers with true once the search is to end.
Stop = Callable[[], bool]

#: Bytes that every cache takes, and its limit.
Caches = Mapping[str, tuple[int, int]]


@dataclass(frozen=True, slots=True)
class ArchipelagoEpoch:
    """An archipelago, and what its islands did to get there.

    Attributes
    ----------
    archipelago : Archipelago
    steps : tuple of tuple of StepInfo
        For every island its generations since the epoch before.
    caches : mapping
        Of all evaluators together.
    """

    archipelago: Archipelago
    steps: tuple[tuple[StepInfo, ...], ...]
    caches: Caches = field(default_factory=dict)


class Engine(Protocol):
    """Carries a search from one epoch to the next.

    Law: the archipelagos depend on the problem and the archipelago given alone; an engine that starts from
    any archipelago that it yielded goes on as if it had never stopped.
    """

    def run(self, problem: Problem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Yield every epoch after ``start``, up to the settings' last generation.

        Parameters
        ----------
        start : Archipelago
            Its islands are those that go on: `founded` ones begin.
        stop : callable
            Asked all the time; once it answers with true, no further epoch is yielded.
        """
        ...


class SerialEngine:
    """Runs the islands one after the other in this process, on one evaluator."""

    def run(self, problem: Problem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """See `Engine`."""
        evaluator = Evaluator(problem.record, problem.settings)
        sources = make_topology(problem, start).sources
        archipelago = start
        leaving = [select_migrants(island, problem.settings_of(island.index)) for island in start.islands]
        while archipelago.generation < problem.settings.generations:
            epochs: list[IslandEpoch] = []
            for island in archipelago.islands:
                arriving = [leaving[source] for source in sources[island.index]]
                epoch = run_epoch(island, arriving, evaluator, problem, stop)
                if epoch is None:
                    return
                epochs.append(epoch)
            archipelago = Archipelago(tuple(epoch.island for epoch in epochs))
            leaving = [epoch.emigrants for epoch in epochs]
            yield ArchipelagoEpoch(archipelago, tuple(epoch.steps for epoch in epochs), evaluator.memory)


def make_topology(problem: Problem, archipelago: Archipelago) -> Topology:
    """Return the topology of an archipelago; it follows from its islands' number and seed."""
    islands = archipelago.islands
    return topology(problem.settings.topology, len(islands), islands[0].seed)
