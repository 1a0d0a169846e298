"""Engines: they run the epochs of a search. All engines yield the same archipelagos, bit for bit."""

from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Protocol

from islands.available_cpus import count_cpus
from islands.evolution.archipelago import Archipelago
from islands.evolution.epoch import IslandEpoch, run_epoch, select_migrants
from islands.evolution.island import StepInfo
from islands.evolution.migration.topology import Topology, parse_topology
from islands.evolution.protocol import Caches, SearchProblem
from islands.progress import Stop


@dataclass(frozen=True, slots=True)
class ArchipelagoEpoch:
    """Archipelago at the end of an epoch, with the statistics of the epoch.

    Attributes
    ----------
    archipelago : Archipelago
    steps : tuple of tuple of StepInfo
        For every island, one entry per generation since the previous epoch.
    caches : mapping
        Memory of the caches, summed over all evaluators.
    """

    archipelago: Archipelago
    steps: tuple[tuple[StepInfo, ...], ...]
    caches: Caches = field(default_factory=dict)


class Engine(Protocol):
    """Interface of engines, which run the epochs of a search.

    Contract: the archipelagos depend only on the problem and on the first archipelago. An engine that starts
    from an archipelago that it yielded earlier continues with the same archipelagos.
    """

    def run(self, problem: SearchProblem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Yield every epoch after ``start``, up to the settings' last generation.

        Parameters
        ----------
        start : Archipelago
            Archipelago to continue from; `empty_archipelago` starts a new search.
        stop : callable
            Called frequently. Once it returns true, no further epoch is yielded.
        """
        ...


class SerialEngine:
    """Engine that runs the islands one after the other in this process, with one set of caches."""

    def run(self, problem: SearchProblem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Yield every epoch after ``start``."""
        evolution = problem.open(count_cpus())
        sources = make_topology(problem, start).sources
        archipelago = start
        leaving = [select_migrants(island, problem.settings_of(island.index)) for island in start.islands]
        while archipelago.generation < problem.settings.generations:
            epochs: list[IslandEpoch] = []
            for island in archipelago.islands:
                arriving = [leaving[source] for source in sources[island.index]]
                epoch = run_epoch(island, arriving, evolution, stop)
                if epoch is None:
                    return
                epochs.append(epoch)
            archipelago = Archipelago(tuple(epoch.island for epoch in epochs))
            leaving = [epoch.emigrants for epoch in epochs]
            yield ArchipelagoEpoch(archipelago, tuple(epoch.steps for epoch in epochs), evolution.memory)


def make_topology(problem: SearchProblem, archipelago: Archipelago) -> Topology:
    """Return the topology for the number of islands and the seed of an archipelago."""
    islands = archipelago.islands
    return parse_topology(problem.settings.topology, len(islands), islands[0].seed)
