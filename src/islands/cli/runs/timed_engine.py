"""Engine with a limit of wall time."""

from collections.abc import Generator
from time import monotonic

from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import ArchipelagoEpoch, Engine
from islands.evolution.problem import Problem
from islands.progress import Stop


class TimedEngine:
    """Engine whose search ends at a time; the steps after the search are not left out."""

    def __init__(self, engine: Engine, until: float) -> None:
        self._engine, self._until = engine, until

    def run(self, problem: Problem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Run the engine."""
        return self._engine.run(problem, start, lambda: stop() or monotonic() > self._until)
