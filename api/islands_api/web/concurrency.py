"""Threads for what waits for the database or the disk, so that no other request is held up meanwhile."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from functools import partial
from typing import ParamSpec, TypeVar

from anyio import CancelScope

P = ParamSpec("P")
T = TypeVar("T")

#: Operations that wait at once.
COUNT = 40


class BlockingExecutor:
    """Carries out operations in threads. The framework's own way takes a third of a look at a job."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(COUNT, "islands-web")

    async def run(self, operation: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
        """Carry out an operation; what it returns or raises comes back here."""
        call = partial(copy_context().run, operation, *arguments, **named)
        done = asyncio.get_running_loop().run_in_executor(self._pool, call)
        try:
            return await asyncio.shield(done)
        except asyncio.CancelledError:
            # The client is gone, the thread is not: what it works with stays open as long.
            with CancelScope(shield=True):
                await asyncio.wait([done])
            raise

    def close(self) -> None:
        """Wait for what is under way, and end the threads."""
        self._pool.shutdown()
