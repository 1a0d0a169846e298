"""The Ray to run on: one of our own on this machine's cores, or a cluster by its address."""

import logging
import os
import secrets
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import ray

from islands.errors import IslandsError

#: Bytes of shared memory for objects of our own Ray: the record, and what islands send to each other.
OBJECT_STORE = 200_000_000

#: Seconds that a cluster may take to answer.
_KNOCK = 5.0

#: What the folders of our own Rays begin with; the number of their process follows.
_PREFIX = "islands-ray-"

#: A socket's path has at most 107 characters, and Ray adds about seventy to its folder's.
_SOCKET_ROOM = 30


class ClusterError(IslandsError):
    """There is no Ray to run on: the message says what to do."""


@contextmanager
def cluster(address: str | None = None, cpus: int | None = None) -> Iterator[None]:
    """Connect to a cluster, or start a Ray of our own that ends with the block and leaves nothing behind.

    Parameters
    ----------
    address : str, optional
        ``HOST:PORT`` of a cluster's head; without one a Ray is started on this machine.
    cpus : int, optional
        Of a Ray of our own; all the cores by default.

    Raises
    ------
    ClusterError
        The address does not answer.
    """
    logging.getLogger("ray").setLevel(logging.CRITICAL)
    if address is None:
        with _own(cpus):
            yield
        return
    try:
        _knock(address)
        ray.init(address=address, log_to_driver=False, configure_logging=False)
    except (OSError, RuntimeError, ValueError) as error:
        raise ClusterError(
            f"no Ray cluster answers at {address} ({error}): start one with 'ray start --head', or run on "
            "this machine, without an address"
        ) from error
    try:
        yield
    finally:
        ray.shutdown()


def _prune(parent: Path) -> None:
    """Remove the folders of runs that were killed."""
    for folder in parent.glob(f"{_PREFIX}*"):
        owner = folder.name.removeprefix(_PREFIX).partition("-")[0]
        if owner.isdecimal() and not Path(f"/proc/{owner}").exists():
            shutil.rmtree(folder, ignore_errors=True)


def _knock(address: str) -> None:
    """Raise an error where nobody is at home: Ray would try for minutes."""
    host, _, port = address.rpartition(":")
    if not host or not port.isdecimal():
        raise ValueError("an address is HOST:PORT")
    socket.create_connection((host, int(port)), timeout=_KNOCK).close()


@contextmanager
def _own(cpus: int | None) -> Iterator[None]:
    # Ray's processes listen on all interfaces: nobody else may talk to them.
    os.environ.setdefault("RAY_AUTH_TOKEN", secrets.token_hex(16))
    parent = Path(tempfile.gettempdir())
    if len(str(parent)) > _SOCKET_ROOM:
        parent = Path("/tmp")
    _prune(parent)
    folder = tempfile.mkdtemp(prefix=f"{_PREFIX}{os.getpid()}-", dir=parent)
    try:
        # Without "local" Ray would attach to any cluster that it finds on the machine.
        ray.init(
            address="local",
            num_cpus=cpus or len(os.sched_getaffinity(0)),
            object_store_memory=OBJECT_STORE,
            include_dashboard=False,
            log_to_driver=False,
            configure_logging=False,
            _temp_dir=folder,
        )
        yield
    finally:
        ray.shutdown()
        shutil.rmtree(folder, ignore_errors=True)
