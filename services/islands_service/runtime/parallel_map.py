"""A pool of cores: calls of one function with many arguments, side by side on Ray."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Any, TypeVar

import ray
from ray.exceptions import RayError, RayTaskError

from islands.discrepancy.interfaces.parallel import ParallelMap
from islands_service.runtime.cluster import cluster
from islands_service.runtime.errors import ClusterError

A = TypeVar("A")
R = TypeVar("R")


@contextmanager
def ray_pool(workers: int | None = None, address: str | None = None) -> Iterator[ParallelMap]:
    """Hold a pool open.

    Parameters
    ----------
    workers : int or None
        Calls at a time; None: as many as there are cores.
    address : str or None
        ``HOST:PORT`` of a cluster; None starts a Ray on this machine.

    Raises
    ------
    ClusterError
        There is no Ray, or it failed. What the function itself raises is raised as it is.
    """
    with cluster(address):
        yield ray_map(workers)


def ray_map(workers: int | None = None) -> ParallelMap:
    """Return a pool on the Ray that this process is connected to when it is called.

    It raises a `ClusterError` where that is none.
    """
    task: Any = ray.remote(num_cpus=1, max_retries=3)(_called)

    def side_by_side(function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
        if not ray.is_initialized():  # Ray would start one of its own
            raise ClusterError("this process is on no Ray: connect it first")
        shared, upcoming = ray.put(function), iter(arguments)
        asked = [task.remote(shared, argument) for argument in islice(upcoming, workers)]
        out = set(asked)
        # The list grows while it is gone through.
        for reference in asked:
            while reference in out:
                done, _ = ray.wait(list(out), num_returns=1)
                out -= set(done)
                more = [task.remote(shared, argument) for argument in islice(upcoming, len(done))]
                asked += more
                out |= set(more)
            try:
                yield ray.get(reference)
            except RayTaskError as error:
                raise error.cause from error
            except RayError as error:
                raise ClusterError(f"Ray failed in a way that nobody can go on from: {error}") from error

    return side_by_side


def _called(function: Callable[[A], R], argument: A) -> R:
    return function(argument)
