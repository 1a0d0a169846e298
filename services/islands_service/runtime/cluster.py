"""The Ray to run on: one of our own on this machine's cores, or a cluster by its address."""

import logging
import os
import secrets
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import ray
from filelock import FileLock, Timeout
from ray.exceptions import (
    LocalRayletDiedError,
    NodeDiedError,
    ObjectLostError,
    OutOfMemoryError,
    RayActorError,
    RayError,
    WorkerCrashedError,
)

from islands_service.runtime.errors import ClusterError

#: Bytes of shared memory for objects of our own Ray: the record, and what islands send to each other.
OBJECT_STORE = 200_000_000

#: Where the names of actors count.
NAMESPACE = "islands"

#: Seconds that a cluster may take to answer.
_KNOCK = 5.0

#: What the folders of our own Rays begin with, and the lock in them that says that somebody is there.
_PREFIX, _LOCK = "islands-ray-", "lock"

#: A socket's path has at most 107 characters, and Ray adds about seventy to its folder's.
_SOCKET_ROOM = 30


#: What says that a machine failed rather than the search: what was asked of it is asked once more.
LOST = (
    RayActorError,
    ObjectLostError,
    WorkerCrashedError,
    OutOfMemoryError,
    NodeDiedError,
    LocalRayletDiedError,
)


@contextmanager
def cluster(address: str | None = None) -> Iterator[None]:
    """Connect to a cluster, or start a Ray of our own that ends with the block and leaves nothing behind.

    Parameters
    ----------
    address : str, optional
        ``HOST:PORT`` of a cluster's head; without one a Ray is started on this machine.

    Raises
    ------
    ClusterError
        The address does not answer, no Ray starts here, or this process has one already.
    """
    if ray.is_initialized():
        raise ClusterError("this process is on a Ray already: leave that first, or run on it by its address")
    logging.getLogger("ray").setLevel(logging.CRITICAL)
    with _own() if address is None else _connected(address):
        yield


@contextmanager
def _connected(address: str) -> Iterator[None]:
    try:
        _knock(address)
        ray.init(address=address, namespace=NAMESPACE, log_to_driver=False, configure_logging=False)
    except (OSError, RuntimeError, ValueError, RayError) as error:
        raise ClusterError(
            f"no Ray cluster answers at {address} ({error}): start one with 'ray start --head', or run on "
            "this machine, without an address"
        ) from error
    try:
        yield
    finally:
        ray.shutdown()


def _prune(parent: Path) -> None:
    """Remove the folders of runs that were killed: a lock ends with the process that holds it."""
    for folder in parent.glob(f"{_PREFIX}*"):
        with suppress(Timeout, OSError), FileLock(folder / _LOCK, timeout=0):
            shutil.rmtree(folder, ignore_errors=True)


def _knock(address: str) -> None:
    """Raise an error where nobody is at home: Ray would try for minutes."""
    host, _, port = address.rpartition(":")
    if not host or not port.isdecimal():
        raise ValueError("an address is HOST:PORT")
    socket.create_connection((host, int(port)), timeout=_KNOCK).close()


def _cpus() -> int:
    """Return the cores that this process may use: fewer than the machine's in a container, or when pinned."""
    cores = len(os.sched_getaffinity(0))
    with suppress(OSError, ValueError):
        quota, period = map(int, Path("/sys/fs/cgroup/cpu.max").read_text().split())
        cores = min(cores, max(1, quota // period))
    return cores


@contextmanager
def _own() -> Iterator[None]:
    # Ray's processes listen on all interfaces: nobody else may talk to them.
    os.environ.setdefault("RAY_AUTH_TOKEN", secrets.token_hex(16))
    parent = Path(tempfile.gettempdir())
    if len(str(parent)) > _SOCKET_ROOM:
        parent = Path("/tmp")
    _prune(parent)
    folder = tempfile.mkdtemp(prefix=_PREFIX, dir=parent)
    lock = FileLock(Path(folder) / _LOCK)
    with lock:
        try:
            # Without "local" Ray would attach to any cluster that it finds on the machine.
            ray.init(
                address="local",
                namespace=NAMESPACE,
                num_cpus=_cpus(),
                object_store_memory=OBJECT_STORE,
                include_dashboard=False,
                log_to_driver=False,
                configure_logging=False,
                _temp_dir=folder,
            )
        except (OSError, RuntimeError, ValueError, RayError) as error:
            raise ClusterError(f"no Ray starts on this machine ({error}): try --engine serial") from error
        try:
            yield
        finally:
            ray.shutdown()
            shutil.rmtree(folder, ignore_errors=True)
