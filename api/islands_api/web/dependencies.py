"""What the doors of one application share: settings, store, blobs, who watches, who asks how much."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ParamSpec, TypeVar

from fastapi import Depends, Request

from islands_api.web.concurrency import BlockingExecutor
from islands_api.web.event_hub import JobEventHub
from islands_api.web.prometheus import ServiceMetrics
from islands_api.web.rate_limit import RateLimiter
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs

P = ParamSpec("P")
T = TypeVar("T")

#: Files that are inspected at once, and figures that are drawn at once: each takes a core.
INSPECTIONS, DRAWINGS = 2, 1


@dataclass(frozen=True, slots=True, eq=False)
class AppState:
    """Made when the application starts, and closed when it ends."""

    settings: ServiceSettings
    store: Store
    blobs: Blobs
    hub: JobEventHub
    rate_limiter: RateLimiter
    metrics: ServiceMetrics
    inspection_slots: asyncio.Semaphore
    figure_slots: asyncio.Semaphore
    executor: BlockingExecutor

    async def run_blocking(self, operation: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
        """Carry out what waits for the database or the disk, without holding up other requests."""
        return await self.executor.run(operation, *arguments, **named)


async def _get_state(request: Request) -> Any:
    # Asynchronous though it waits for nothing: the framework gives any other one a thread, for every request.
    return request.app.state.islands


#: What a route asks for to get at them.
AppStateDep = Annotated[AppState, Depends(_get_state)]
