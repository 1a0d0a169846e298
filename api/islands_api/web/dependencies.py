"""State shared by the routes of one application, and the dependency that injects it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ParamSpec, TypeVar

from fastapi import Depends, Request

from islands_api.web.concurrency import BlockingExecutor
from islands_api.web.event_hub import JobEventHub
from islands_api.web.limits.owner_counts import OwnerCounts
from islands_api.web.limits.owner_slots import OwnerSlots
from islands_api.web.limits.rate import RateLimiter
from islands_api.web.prometheus import ServiceMetrics
from islands_api.web.responses import QueuePlaces
from islands_api.web.uploads.admission import UploadAdmission
from islands_service.domain.owner import Quotas, default_quotas
from islands_service.outbound.checked_client import CheckedClient
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs

if TYPE_CHECKING:
    from islands_api.oidc.token_verifier import TokenVerifier

P = ParamSpec("P")
T = TypeVar("T")

#: Maximum number of uploads that are inspected at once; each takes a core.
MAX_CONCURRENT_INSPECTIONS = 2

#: Maximum number of uploads of one owner that are inspected at once: an inspection may take two minutes.
MAX_INSPECTIONS_PER_OWNER = 1

#: Maximum number of figure processes at once; each takes a core.
MAX_CONCURRENT_DRAWINGS = 1


@dataclass(frozen=True, slots=True, eq=False)
class AppState:
    """Settings, store and shared services of one application, from its startup to its shutdown."""

    settings: ServiceSettings
    store: Store
    blobs: Blobs
    hub: JobEventHub
    rate_limiter: RateLimiter
    metrics: ServiceMetrics
    uploads: UploadAdmission
    inspection_slots: OwnerSlots
    figure_slots: OwnerSlots
    drawings: OwnerCounts
    streams: OwnerCounts
    executor: BlockingExecutor
    outbound: CheckedClient
    tokens: "TokenVerifier | None"
    places: QueuePlaces = field(default_factory=QueuePlaces)

    async def quotas(self, owner: str) -> Quotas:
        """Return the quotas of an owner."""
        return await self.run_blocking(self.store.owners.quotas, owner, default_quotas(self.settings))

    async def run_blocking(self, operation: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run an operation that waits for the database or the disk in a thread."""
        return await self.executor.run(operation, *args, **kwargs)


async def _get_state(request: Request) -> Any:
    # Asynchronous although it never waits: the framework runs synchronous dependencies in a thread.
    return request.app.state.islands


#: Type of a route parameter that receives the application state.
AppStateDep = Annotated[AppState, Depends(_get_state)]
