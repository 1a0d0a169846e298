"""Parallel map on Ray: ordered results of one function called with many arguments."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Any, TypeVar

import ray
from ray.exceptions import RayError, RayTaskError

from islands.parallel import ParallelMap
from islands_service.runtime import ClusterError
from islands_service.runtime.cluster import cluster, cluster_cpus, reserved_cpus

#: Seconds between two checks.
_CHECK_SECONDS = 0.1

A = TypeVar("A")
R = TypeVar("R")


@contextmanager
def ray_pool(
    workers: int | None = None, address: str | None = None, check: Callable[[], object] = lambda: None
) -> Iterator[ParallelMap]:
    """Provide a parallel map on a Ray cluster while the block runs.

    Parameters
    ----------
    workers : int or None
        Concurrent calls; None for one per core.
    address : str or None
        ``HOST:PORT`` of a cluster; None starts a local Ray.
    check : callable
        See `ray_map`.

    Raises
    ------
    ClusterError
        Ray is unavailable or failed. Errors of the function itself are raised unchanged.
    """
    with cluster(address):
        yield ray_map(workers, check)


def ray_map(workers: int | None = None, check: Callable[[], object] = lambda: None) -> ParallelMap:
    """Return a parallel map on the Ray cluster to which this process is connected when the map is called.

    The map raises a `ClusterError` if the process is not connected to Ray, or if Ray fails.

    Parameters
    ----------
    workers : int or None
        See `ray_pool`.
    check : callable
        Called many times a second during the computation. If it raises an error, all calls are ended.
    """

    def parallel_map(function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
        if not ray.is_initialized():  # otherwise Ray would start a local instance
            raise ClusterError("this process is not connected to Ray: connect it first")
        reserved = reserved_cpus()
        task: Any = ray.remote(num_cpus=reserved, max_retries=3)(_call)
        at_once = int(cluster_cpus()) if workers is None and reserved < 1.0 else workers
        shared, upcoming = ray.put(function), iter(arguments)
        submitted = [task.remote(shared, argument) for argument in islice(upcoming, at_once)]
        pending = set(submitted)
        # The list grows during the iteration.
        try:
            for reference in submitted:
                while reference in pending:
                    check()
                    done, _ = ray.wait(list(pending), num_returns=1, timeout=_CHECK_SECONDS)
                    pending -= set(done)
                    more = [task.remote(shared, argument) for argument in islice(upcoming, len(done))]
                    submitted += more
                    pending |= set(more)
                try:
                    yield ray.get(reference)
                except RayTaskError as error:
                    raise error.cause from error
                except RayError as error:
                    raise ClusterError(f"Ray failed, and the computation cannot continue: {error}") from error
        finally:
            for reference in pending:
                # A compiled kernel cannot be interrupted: end its process.
                ray.cancel(reference, force=True)

    return parallel_map


def _call(function: Callable[[A], R], argument: A) -> R:
    return function(argument)
