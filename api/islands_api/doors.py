"""What the doors of one application share: settings, store, blobs, who watches, who asks how much."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor
from contextvars import copy_context
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ParamSpec, TypeVar

from fastapi import Depends, Request

from islands_api.hub import Hub
from islands_api.measures import Measures
from islands_api.rate import Rate
from islands_service.blobs import Blobs
from islands_service.settings import ServiceSettings
from islands_service.store import Store

P = ParamSpec("P")
T = TypeVar("T")

#: Files that are inspected at once, and figures that are drawn at once: each takes a core.
INSPECTIONS, DRAWINGS = 2, 1

#: Operations that wait for the database or the disk at once.
THREADS = 40


@dataclass(frozen=True, slots=True, eq=False)
class Doors:
    """Made when the application starts, and closed when it ends."""

    settings: ServiceSettings
    store: Store
    blobs: Blobs
    hub: Hub
    rate: Rate
    measures: Measures
    inspections: asyncio.Semaphore
    drawings: asyncio.Semaphore
    threads: Executor

    async def do(self, operation: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
        """Carry out what waits for the database or the disk, without holding up other requests.

        The framework's own way to a thread takes a third of what a look at a job does.
        """
        call = partial(copy_context().run, operation, *arguments, **named)
        done = asyncio.get_running_loop().run_in_executor(self.threads, call)
        try:
            return await asyncio.shield(done)
        except asyncio.CancelledError:
            # The client is gone, the thread is not: what it works with stays open as long.
            await asyncio.wait([done])
            raise


async def _doors(request: Request) -> Any:
    # Asynchronous though it waits for nothing: the framework gives any other one a thread, for every request.
    return request.app.state.doors


#: What a route asks for to get at them.
AtDoors = Annotated[Doors, Depends(_doors)]
