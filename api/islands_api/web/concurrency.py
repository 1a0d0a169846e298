"""Thread pool for operations that wait for the database or the disk, to keep the event loop free."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from functools import partial
from typing import ParamSpec, TypeVar

from anyio import CancelScope

P = ParamSpec("P")
T = TypeVar("T")

#: Maximum number of blocking operations at once.
MAX_THREADS = 40


class BlockingExecutor:
    """Thread pool for blocking operations.

    The framework's own thread pool takes a third of the time of a request for a job.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(MAX_THREADS, "islands-web")

    async def run(self, operation: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run an operation in a thread with a copy of the current context, and return its result."""
        call = partial(copy_context().run, operation, *args, **kwargs)
        future = asyncio.get_running_loop().run_in_executor(self._pool, call)
        try:
            return await asyncio.shield(future)
        except asyncio.CancelledError:
            # The client has disconnected, but the thread still runs: keep its files open until it ends.
            with CancelScope(shield=True):
                await asyncio.wait([future])
            raise

    def close(self) -> None:
        """Wait for running operations, then stop the threads."""
        self._pool.shutdown()
