"""Engines of a search on the command line: serial or Ray, with a limit of wall time."""

from collections.abc import Generator, Iterator
from contextlib import ExitStack, closing, contextmanager
from importlib.util import find_spec
from time import monotonic

from islands.distribution import describe_missing_extra
from islands.errors import EngineError, SettingsError
from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import ArchipelagoEpoch, Engine, SearchProblem, SerialEngine
from islands.facade.engine_choice import Ray, open_engine
from islands.progress import ProgressCallback, Stop, TimeLimit

#: Names of the engines.
ENGINES = ("serial", "ray")


@contextmanager
def start_engine(
    name: str | None, address: str | None, islands: int, progress: ProgressCallback
) -> Iterator[Engine]:
    """Start the engine of a search for a ``with`` block; all engines give the same result.

    Without a name or an address, several islands run on Ray. Where it is not installed or does not start,
    they run on one core, and a message says so.

    Parameters
    ----------
    name : str or None
        One of `ENGINES`.
    address : str or None
        ``HOST:PORT`` of a Ray cluster; None for this machine.
    islands : int
        Number of islands of the search. Ray starts in three seconds, and one island does not need it.
    progress : ProgressCallback
        Receives the messages of the engine.

    Raises
    ------
    EngineError
        Ray was chosen, by its name or by an address, and does not start.
    """
    is_chosen = name == "ray" or address is not None
    with ExitStack() as stack:
        engine: Engine = SerialEngine()
        if is_chosen or (name is None and islands > 1):
            try:
                if not is_chosen and not has_ray():
                    raise EngineError(describe_missing_extra("a search on all cores", "ray"))
                engine = stack.enter_context(open_engine(Ray(address), progress))
            except EngineError as error:
                if is_chosen:
                    raise
                progress(f"engine: serial, on one core, with the same result; {error}")
        yield engine


def has_ray() -> bool:
    """Return whether Ray is installed."""
    return find_spec("ray") is not None


def check_engine(name: str | None, address: str | None) -> None:
    """Check that the packages of a chosen engine are installed, before the kernels are compiled.

    Raises
    ------
    SettingsError
        They are not.
    """
    if (name == "ray" or address is not None) and not has_ray():
        raise SettingsError(describe_missing_extra("the engine ray", "ray"))


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

    def run(self, problem: SearchProblem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Run the next search."""
        limit = TimeLimit(self._until, monotonic, stop).share(self._left)
        self._left = max(1, self._left - 1)
        begun = False
        epochs = self._engine.run(problem, start, lambda: limit() if begun else stop())
        with closing(epochs):
            for epoch in epochs:
                begun = True
                yield epoch
