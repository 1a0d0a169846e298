"""Table of search engines: serial and Ray. The core finds Ray by its entry point in ``pyproject.toml``."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from types import MappingProxyType

from islands.evolution.engine import Engine, SerialEngine
from islands.progress import ProgressCallback


@contextmanager
def serial_engine(
    _address: str | None = None, _progress: ProgressCallback = print, _cpus: int | None = None
) -> Iterator[Engine]:
    """Run islands one after the other in this process."""
    yield SerialEngine()


@contextmanager
def ray_engine(
    address: str | None = None, progress: ProgressCallback = print, cpus: int | None = None
) -> Iterator[Engine]:
    """Run islands in parallel with Ray.

    ``islands.identify(..., engine="ray")`` opens this engine for one search; several searches may share an
    engine, ``with ray_engine() as engine: islands.identify(..., engine=engine)``.

    Parameters
    ----------
    address : str, optional
        ``HOST:PORT`` of the head of a Ray cluster. If None, Ray is started on the cores of this machine and
        ends with the block.
    progress : ProgressCallback
        Receives a message if an actor is lost or must wait for a CPU.
    cpus : int, optional
        Number of cores of this machine that a Ray started here uses; all by default.

    Raises
    ------
    ClusterError
        The address does not answer, Ray does not start, or this process is already connected to Ray.
    """
    # Importing Ray takes a quarter of a second, and only this engine needs it.
    from islands_service.runtime.cluster import cluster  # noqa: PLC0415
    from islands_service.runtime.ray_engine import RayEngine  # noqa: PLC0415

    with cluster(address, cpus):
        yield RayEngine(progress)


#: Opens an engine, given the address of a cluster (None for this machine) and a callback for messages.
EngineFactory = Callable[[str | None, ProgressCallback], AbstractContextManager[Engine]]

#: Engines by name.
ENGINES: Mapping[str, EngineFactory] = MappingProxyType({"serial": serial_engine, "ray": ray_engine})
