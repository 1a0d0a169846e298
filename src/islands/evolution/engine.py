"""Engines: how epochs are carried out. Every engine yields the same archipelagos, bit for bit."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from islands.evolution.archipelago import Archipelago
from islands.evolution.evaluation import Evaluator
from islands.evolution.island import StepInfo, first_generation, step
from islands.evolution.problem import Problem


@dataclass(frozen=True, slots=True)
class Epoch:
    """An archipelago, what its islands did to get there, and what their caches take: (bytes, limit)."""

    archipelago: Archipelago
    info: StepInfo
    caches: Mapping[str, tuple[int, int]] = field(default_factory=dict)


class Engine(Protocol):
    """Carries a search from one epoch to the next.

    Law: the archipelagos depend on the problem, the seed and the archipelago given alone; an engine that
    starts from any archipelago that it yielded goes on as if it had never stopped.
    """

    def run(self, problem: Problem, seed: int, islands: int, start: Archipelago) -> Iterator[Epoch]:
        """Yield every epoch after ``start``, up to the settings' last generation.

        Parameters
        ----------
        islands : int
            How many, where ``start`` is empty; else those of ``start``.
        """
        ...


class SerialEngine:
    """Runs the islands one after the other in this process."""

    def run(self, problem: Problem, seed: int, islands: int, start: Archipelago) -> Iterator[Epoch]:
        """See `Engine`."""
        evaluator = Evaluator(problem.record, problem.settings)
        archipelago = start
        while archipelago.epoch < problem.settings.generations:
            if archipelago.epoch < 0:
                stepped = [
                    first_generation(index, seed, evaluator, problem.seeds) for index in range(islands)
                ]
            else:
                stepped = [step(island, evaluator, problem.pool) for island in archipelago.islands]
            archipelago = Archipelago(tuple(island for island, _ in stepped), archipelago.epoch + 1)
            yield Epoch(archipelago, together([info for _, info in stepped]), evaluator.memory)


def together(infos: Sequence[StepInfo]) -> StepInfo:
    """Add up what islands did."""
    outcomes: Counter[str] = Counter()
    for info in infos:
        outcomes.update(info.outcomes)
    return StepInfo(
        sum(info.evaluations for info in infos), sum(info.duplicates for info in infos), dict(outcomes)
    )
