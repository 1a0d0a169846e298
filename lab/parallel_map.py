"""Parallel map of the measurements that take hours."""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from islands.cli.console import print_message
from islands.cli.engines import has_ray
from islands.errors import EngineError
from islands.parallel import ParallelMap
from islands.process_pool import process_pool


@contextmanager
def open_pool(workers: int | None, address: str | None, check: Callable[[], object]) -> Iterator[ParallelMap]:
    """Open a parallel map for a ``with`` block: on Ray, or on processes where it is absent or does not start.

    Parameters
    ----------
    workers : int or None
        Concurrent calls; None for one per core.
    address : str or None
        ``HOST:PORT`` of a Ray cluster; None for this machine.
    check : callable
        Called many times a second. If it raises an error, all calls are ended.

    Raises
    ------
    EngineError
        No cluster answers at the address.
    """
    with ExitStack() as stack:
        parallel_map: ParallelMap | None = None
        if address is not None or has_ray():
            from islands_service.runtime.parallel_map import ray_pool

            # Processes of Ray do not have the path of this one.
            paths = [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
            os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
            try:
                parallel_map = stack.enter_context(ray_pool(workers, address, check))
            except EngineError as error:
                if address is not None:
                    raise
                print_message(f"processes in place of Ray, with the same result; {error}")
        if parallel_map is None:
            parallel_map = stack.enter_context(process_pool(workers, start_after=0.0, check=check))
        yield parallel_map
