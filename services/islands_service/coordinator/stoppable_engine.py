"""Engine of a job whose owner can end the search early, with the best models so far."""

from collections.abc import Callable, Generator
from contextlib import closing

from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import ArchipelagoEpoch, Engine
from islands.evolution.protocol import SearchProblem
from islands.progress import Stop


class StoppableEngine:
    """Engine wrapper that ends the epochs of a search at the request of the owner of the job.

    The steps after the epochs follow as after a complete search. The first population is always evaluated, so
    that there are models.

    Parameters
    ----------
    engine : Engine
    is_stopped : callable
        Returns whether the owner has asked for the end of the search.
    on_problem : callable
        Receives the problem of each search.
    least : int
        Generation before which the request ends no search: an earlier attempt, which was killed, has reached
        it, and the owner has seen its models.
    """

    def __init__(
        self, engine: Engine, is_stopped: Stop, on_problem: Callable[[SearchProblem], None], least: int = 0
    ) -> None:
        self._engine, self._is_stopped, self._on_problem = engine, is_stopped, on_problem
        self._least = least

    def run(self, problem: SearchProblem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Yield the epochs of a search; see `islands.evolution.engine.Engine`."""
        self._on_problem(problem)
        reached, least = start.generation, min(self._least, problem.settings.generations)

        def ends() -> bool:
            return stop() or (reached >= least and self._is_stopped())

        with closing(self._engine.run(problem, start, ends)) as epochs:
            for epoch in epochs:
                reached = epoch.archipelago.generation
                yield epoch
