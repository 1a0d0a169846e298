"""Engine with a limit of wall time."""

from collections.abc import Generator
from contextlib import closing
from time import monotonic

from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import ArchipelagoEpoch, Engine
from islands.evolution.problem import Problem
from islands.progress import Stop, TimeLimit


class TimedEngine:
    """Engine whose searches end at a time, but not before their first epoch.

    The steps after a search are not left out.

    Parameters
    ----------
    engine : Engine
    until : float
        Monotonic time at which the last search ends.
    searches : int
        Number of searches, one after the other. Each has an equal part of the time that is left.
    """

    def __init__(self, engine: Engine, until: float, searches: int = 1) -> None:
        self._engine, self._until, self._left = engine, until, searches

    def run(self, problem: Problem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Run the next search."""
        limit = TimeLimit(self._until, monotonic, stop).share(self._left)
        self._left = max(1, self._left - 1)
        begun = False
        epochs = self._engine.run(problem, start, lambda: limit() if begun else stop())
        with closing(epochs):
            for epoch in epochs:
                begun = True
                yield epoch
