"""The table of engines: how a search may be carried out."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from types import MappingProxyType

from islands.evolution.engine import Engine, SerialEngine
from islands.evolution.progress import ProgressCallback


@contextmanager
def _serial(_address: str | None, _progress: ProgressCallback) -> Iterator[Engine]:
    yield SerialEngine()


@contextmanager
def _ray(address: str | None, progress: ProgressCallback) -> Iterator[Engine]:
    # Ray takes a quarter of a second to import, and only this engine needs it.
    from islands_service.runtime.cluster import cluster  # noqa: PLC0415
    from islands_service.runtime.ray_engine import RayEngine  # noqa: PLC0415

    with cluster(address):
        yield RayEngine(progress)


#: Engines by name. Each takes the address of a cluster, None for this machine, and a progress callback.
ENGINES: Mapping[str, Callable[[str | None, ProgressCallback], AbstractContextManager[Engine]]] = (
    MappingProxyType({"serial": _serial, "ray": _ray})
)
