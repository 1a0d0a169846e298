"""Engines of a search on the command line: serial, or Ray, whose factory is an entry point."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from importlib.metadata import entry_points
from importlib.util import find_spec

from islands.distribution import describe_missing_extra
from islands.errors import SettingsError
from islands.evolution.engine import Engine, SerialEngine
from islands.facade.engine_choice import GROUP
from islands.parallel import ParallelMap
from islands.progress import ProgressCallback

#: Names of the engines.
ENGINES = ("serial", "ray")

#: Entry point group of functions ``open(workers, address, check)`` that open a parallel map on a cluster.
PARALLEL_MAPS = "islands.parallel_maps"


def start_engine(
    name: str, address: str | None, progress: ProgressCallback
) -> AbstractContextManager[Engine]:
    """Return an engine of `ENGINES` for a ``with`` block.

    Parameters
    ----------
    address : str or None
        ``HOST:PORT`` of a Ray cluster; None for this machine.
    progress : ProgressCallback
        Receives the messages of the engine.
    """
    if name == "serial":
        return nullcontext(SerialEngine())
    (entry,) = entry_points(group=GROUP, name=name)
    engine: AbstractContextManager[Engine] = entry.load()(address, progress)
    return engine


def ray_pool(
    workers: int | None, address: str | None, check: Callable[[], object]
) -> AbstractContextManager[ParallelMap]:
    """Return a parallel map on Ray for a ``with`` block.

    Parameters
    ----------
    workers : int or None
        Concurrent calls; None for one per core.
    address : str or None
        ``HOST:PORT`` of a cluster; None starts a local Ray.
    check : callable
        Called many times a second. If it raises an error, all calls are ended.
    """
    (entry,) = entry_points(group=PARALLEL_MAPS, name="ray")
    pool: AbstractContextManager[ParallelMap] = entry.load()(workers, address, check)
    return pool


def has_ray() -> bool:
    """Return whether Ray is installed."""
    return find_spec("ray") is not None


def check_engine(name: str) -> None:
    """Check that the packages of an engine are installed, before the kernels are compiled.

    Raises
    ------
    SettingsError
        They are not.
    """
    if name == "ray" and not has_ray():
        raise SettingsError(describe_missing_extra("the engine ray", "ray"))


def serial_notice() -> str:
    """Return the notice of a command that runs several islands on one core, since Ray is not installed."""
    return f"engine: serial, on one core; {describe_missing_extra('a search on all cores', 'ray')}"


def default_engine(islands: int, address: str | None = None) -> str:
    """Return the name of the engine of a search for which none is chosen; all give the same result.

    It is Ray for several islands and with the address of a cluster. Ray starts in three seconds, and one
    island does not need it. Without Ray, it is the serial engine unless an address is given.
    """
    return "ray" if address or (islands > 1 and has_ray()) else "serial"
