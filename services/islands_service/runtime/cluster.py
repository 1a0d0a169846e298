"""Connection to Ray: a local instance on the cores of this machine, or a cluster by its address."""

import logging
import os
import secrets
import shutil
import signal
import socket
import stat
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from math import inf
from pathlib import Path
from threading import current_thread, main_thread

import ray
from filelock import FileLock, Timeout
from ray._common.network_utils import is_localhost
from ray._private import ray_constants
from ray._private.node import Node
from ray.exceptions import (
    LocalRayletDiedError,
    NodeDiedError,
    ObjectLostError,
    OutOfMemoryError,
    RayActorError,
    RayError,
    WorkerCrashedError,
)

from islands.available_cpus import count_cpus
from islands.distribution import read_version
from islands.progress import StoppedError
from islands_service.runtime import ClusterError

#: Bytes of shared memory of a local Ray: it holds the record and the migrants.
OBJECT_STORE_BYTES = 200_000_000

#: Ray namespace of the names of actors.
NAMESPACE = "islands"

#: Seconds that a cluster may take to accept a connection.
_CONNECT_TIMEOUT = 5.0

#: Prefix of the temporary folders of local Ray instances.
_PREFIX = "islands-ray-"

#: Resource of a local Ray: the number of jobs that share its cores.
_JOBS = "islands-jobs"

#: Lock file in such a folder, held while the instance runs.
_LOCK = "lock"

#: Folder of Ray in such a folder. Ray opens the folder that it uses to all users (mode 0777), so the folder
#: lies in one that only the user of this process may enter.
_SESSIONS = "r"

#: Longest path of the parent folder: a socket path has at most 107 bytes. ``/islands-ray-`` and eight
#: characters, ``/r``, ``/session_`` with date, time and process id, and ``/sockets/plasma_store`` take 87.
_MAX_PARENT_LENGTH = 20


#: Errors of a failed machine or process rather than of the search. The computation is repeated.
LOSS_ERRORS = (
    RayActorError,
    ObjectLostError,
    WorkerCrashedError,
    OutOfMemoryError,
    NodeDiedError,
    LocalRayletDiedError,
)


@contextmanager
def cluster(address: str | None = None, cpus: int | None = None, jobs: int = 1) -> Iterator[None]:
    """Connect to a cluster, or start a local Ray that ends with the block and removes its files.

    Parameters
    ----------
    address : str, optional
        ``HOST:PORT`` of the head of a cluster; by default a local Ray is started.
    cpus : int, optional
        Number of cores that a local Ray uses; by default all that this process may use.
    jobs : int
        Number of jobs that share the cores of a local Ray; see `reserved_cpus`.

    Raises
    ------
    ClusterError
        The address does not answer, Ray does not start here, or this process is already connected to Ray.
    StoppedError
        SIGTERM has arrived during the start, and its handler has not raised an exception.
    """
    if ray.is_initialized():
        raise ClusterError(
            "this process is already connected to Ray: disconnect first, or give the address of that cluster"
        )
    logging.getLogger("ray").setLevel(logging.CRITICAL)
    # Otherwise Ray replaces a loopback address by that of a network interface, and listens on all of them.
    ray_constants.ENABLE_RAY_CLUSTER = address is not None and not is_localhost(address.rpartition(":")[0])
    handler = signal.getsignal(signal.SIGTERM)
    handled = callable(handler) and current_thread() is main_thread()
    with ExitStack() as stack:
        try:
            stack.enter_context(
                _local_ray(cpus or count_cpus(), jobs) if address is None else _remote_cluster(address)
            )
        except SystemExit:
            # Ray's own handler of SIGTERM, which it sets while it starts.
            if not handled:
                raise
            signal.signal(signal.SIGTERM, handler)
            signal.raise_signal(signal.SIGTERM)
            raise StoppedError("start of Ray") from None
        if handled:
            signal.signal(signal.SIGTERM, handler)  # Ray has replaced it by its own
        yield


def cluster_memory() -> float:
    """Return the memory in bytes that the machines of the connected cluster offer; infinite if unknown."""
    return float(ray.cluster_resources().get("memory", inf))


def cluster_cpus() -> float:
    """Return the number of CPUs that the machines of the connected cluster offer."""
    return float(ray.cluster_resources().get("CPU", 0.0))


def reserved_cpus() -> float:
    """Return the number of CPUs that an actor or a task of the connected cluster reserves.

    The jobs of one machine share its cores in time, so that none waits for the end of another: each may have
    as many processes as there are cores. On other clusters each process has a CPU.
    """
    # Ray counts in units of 0.0001.
    return int(10_000 / ray.cluster_resources().get(_JOBS, 1.0)) / 10_000


def check_version(found: str) -> None:
    """Check the version of islands on another machine.

    Raises
    ------
    ClusterError
    """
    if found != read_version():
        raise ClusterError(
            f"a machine of the cluster has islands {found}, this one {read_version()}: the result would "
            "depend on the machine that computes it; install one version on all"
        )


@contextmanager
def _remote_cluster(address: str) -> Iterator[None]:
    try:
        _check_reachable(address)
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


def _remove_stale_folders(parent: Path) -> None:
    """Remove the folders of killed runs: their locks were released when the processes ended."""
    for folder in parent.glob(f"{_PREFIX}*"):
        with suppress(Timeout, OSError):
            if _is_private(folder):
                with FileLock(folder / _LOCK, timeout=0):
                    shutil.rmtree(folder, ignore_errors=True)


def _is_private(folder: Path) -> bool:
    """Return whether a folder belongs to the user of this process, and no other user may enter it.

    A link or a folder of another user could make this process open, or remove, files elsewhere.
    """
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & 0o077


def _check_reachable(address: str) -> None:
    """Raise an error if nothing listens at the address: Ray would retry for minutes."""
    host, _, port = address.rpartition(":")
    if not host or not port.isdecimal():
        raise ValueError("an address is HOST:PORT")
    socket.create_connection((host, int(port)), timeout=_CONNECT_TIMEOUT).close()


class _LocalNode(Node):  # type: ignore[misc]
    """Node of Ray without the processes that a single machine does not need.

    They are the autoscaler, the log monitor, which sends the output of actors to drivers that ask for it, and
    the server of the dashboard, which Ray starts even without a dashboard. Each of them imports for a second,
    and Ray waits for the last one.

    A node that does not start ends the processes that it has started; Ray's would leave them to this process.
    """

    def __init__(self, *arguments: object, **options: object) -> None:
        try:
            super().__init__(*arguments, **options)
        except BaseException:
            self.kill_all_processes(check_alive=False, wait=True)
            raise

    def start_monitor(self) -> None:
        pass

    def start_log_monitor(self) -> None:
        pass

    def start_api_server(self, **_options: object) -> None:
        pass


@contextmanager
def _without_unused_processes() -> Iterator[None]:
    """Replace the class of nodes of `ray.init`, which has no options for this.

    The class is private. The locked version of Ray has these methods, and a test starts it; a version without
    one of them starts all processes.
    """
    ray._private.node.Node = _LocalNode
    try:
        yield
    finally:
        ray._private.node.Node = Node


@contextmanager
def _local_ray(cpus: int, jobs: int) -> Iterator[None]:
    # Ray's processes listen on the loopback interface: the token keeps other users of this machine out.
    os.environ.setdefault("RAY_AUTH_TOKEN", secrets.token_hex(16))
    with ExitStack() as stack:
        try:
            parent = Path(tempfile.gettempdir())
            if len(os.fsencode(parent)) > _MAX_PARENT_LENGTH:
                parent = Path("/tmp")
            _remove_stale_folders(parent)
            folder = tempfile.mkdtemp(prefix=_PREFIX, dir=parent)
            stack.enter_context(FileLock(Path(folder) / _LOCK))
            stack.callback(shutil.rmtree, folder, ignore_errors=True)
            stack.callback(ray.shutdown)
            with _without_unused_processes():
                # Without "local" Ray would attach to any cluster on the machine.
                ray.init(
                    address="local",
                    namespace=NAMESPACE,
                    num_cpus=cpus,
                    resources={_JOBS: jobs},
                    object_store_memory=OBJECT_STORE_BYTES,
                    include_dashboard=False,
                    log_to_driver=False,
                    configure_logging=False,
                    _temp_dir=str(Path(folder) / _SESSIONS),
                )
        except Exception as error:  # Ray raises plain exceptions, too, for example after a timeout
            raise ClusterError(
                f"Ray does not start on this machine ({error}): end other programs, or do without Ray"
            ) from error
        yield
