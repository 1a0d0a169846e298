"""State shared by the routes of one application, and the dependency that injects it."""

from collections import OrderedDict, defaultdict
from collections.abc import AsyncIterator, Callable, Hashable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from logging import ERROR
from threading import Lock
from typing import TYPE_CHECKING, Annotated, Any, Generic, ParamSpec, TypeAlias, TypeVar

import numpy as np
from fastapi import Depends, Request
from numpy.typing import NDArray

from islands.records.coupled import AnyRecord
from islands_api.web.event_hub import JobEventHub
from islands_api.web.limits import BlockingExecutor, OwnerCounts, OwnerSlots, RateLimiter, UploadAdmission
from islands_api.web.model_simulation import SimulatedModel
from islands_api.web.prometheus import ServiceMetrics
from islands_api.web.responses import QueuePlaces
from islands_service.domain.owner import Quotas, default_quotas
from islands_service.intake.file_inspection import count_slots
from islands_service.logs import OutageLog
from islands_service.outbound import CheckedClient, make_checked_client
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.cached_blobs import open_blobs

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class RecentValues(Generic[K, V]):
    """Values that were used last, by keys that determine them, so that a request has the same answer without.

    Parameters
    ----------
    most : int
        Largest sum of the weights of the values. A value that weighs more is not kept.
    weigh : callable
        Returns the weight of a value; by default each has the weight 1.
    """

    def __init__(self, most: int, weigh: Callable[[V], int] = lambda _: 1) -> None:
        self._most, self._weigh = most, weigh
        self._weight = 0
        self._values: OrderedDict[K, V] = OrderedDict()
        self._lock = Lock()

    def get(self, key: K) -> V | None:
        """Return a value; None if it is not in memory."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
            return self._values.get(key)

    def store(self, key: K, value: V) -> None:
        """Store a value; those that were not used for the longest time are removed if they weigh too much."""
        with self._lock:
            if self._weigh(value) > self._most:
                return
            if key in self._values:
                self._weight -= self._weigh(self._values.pop(key))
            self._values[key] = value
            self._weight += self._weigh(value)
            while self._weight > self._most:
                _, removed = self._values.popitem(last=False)
                self._weight -= self._weigh(removed)


if TYPE_CHECKING:
    from islands_api.token_verifier import TokenVerifier

P = ParamSpec("P")
T = TypeVar("T")

#: Number of the largest files that may be inspected at once, as far as there is room for one more.
MAX_CONCURRENT_INSPECTIONS = 3

#: Maximum number of uploads of one owner that are inspected at once: the owners share the cores.
MAX_INSPECTIONS_PER_OWNER = 1

#: Maximum number of simulations at once, and of one owner: each takes a core for milliseconds.
MAX_CONCURRENT_SIMULATIONS, MAX_SIMULATIONS_PER_OWNER = 2, 1

#: Maximum numbers of simulated models, some kilobytes each, and of their records in memory: 50 000 samples of
#: one input are 0.8 MB.
MAX_KEPT_MODELS, MAX_KEPT_RECORDS = 64, 8

#: Largest number of bytes of the columns in memory for plots: eight of a million samples.
MAX_COLUMN_BYTES = 64_000_000

#: An owner, a data set and names of columns.
ColumnsKey: TypeAlias = tuple[str, str, tuple[str, ...]]

#: A job, its version, which changes with its result, and the rank of a model.
ModelKey: TypeAlias = tuple[str, int, int]

#: A model, and its operating point: levels by column.
LinearKey: TypeAlias = tuple[str, int, int, tuple[tuple[str, float], ...]]

#: Largest number of characters of figures of linear systems in memory: some hundred thousand for each model.
MAX_LINEAR_CHARACTERS = 16_000_000

#: Maximum number of figure processes at once; each takes a core.
MAX_CONCURRENT_DRAWINGS = 1


@dataclass(frozen=True, slots=True, eq=False)
class AppState:
    """Settings, store and shared services of one application; `open_state` makes it from the settings."""

    settings: ServiceSettings
    store: Store
    blobs: Blobs
    hub: JobEventHub
    rate_limiter: RateLimiter
    metrics: ServiceMetrics
    uploads: UploadAdmission
    executor: BlockingExecutor
    outbound: CheckedClient
    tokens: "TokenVerifier | None"
    inspection_slots: OwnerSlots
    figure_slots: OwnerSlots = field(
        default_factory=lambda: OwnerSlots(MAX_CONCURRENT_DRAWINGS, MAX_CONCURRENT_DRAWINGS)
    )
    simulation_slots: OwnerSlots = field(
        default_factory=lambda: OwnerSlots(MAX_CONCURRENT_SIMULATIONS, MAX_SIMULATIONS_PER_OWNER)
    )
    simulated_models: RecentValues[ModelKey, SimulatedModel] = field(
        default_factory=lambda: RecentValues(MAX_KEPT_MODELS)
    )
    simulated_records: RecentValues[ModelKey, AnyRecord] = field(
        default_factory=lambda: RecentValues(MAX_KEPT_RECORDS)
    )
    linear_figures: RecentValues[LinearKey, Mapping[str, str]] = field(
        default_factory=lambda: RecentValues(
            MAX_LINEAR_CHARACTERS, lambda drawn: sum(map(len, drawn.values()))
        )
    )
    plotted_columns: RecentValues[ColumnsKey, NDArray[np.float64]] = field(
        default_factory=lambda: RecentValues(MAX_COLUMN_BYTES, lambda values: values.nbytes)
    )
    drawings: OwnerCounts = field(default_factory=lambda: OwnerCounts("requests for figures"))
    streams: OwnerCounts = field(default_factory=lambda: OwnerCounts("event streams"))
    places: QueuePlaces = field(default_factory=QueuePlaces)
    outages: defaultdict[str, OutageLog] = field(
        default_factory=lambda: defaultdict(
            lambda: OutageLog("request failed", "requests succeed again", level=ERROR)
        )
    )

    async def quotas(self, owner: str) -> Quotas:
        """Return the quotas of an owner."""
        return await self.run_blocking(self.store.owners.quotas, owner, default_quotas(self.settings))

    async def run_blocking(self, operation: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run an operation that waits for the database or the disk in a thread."""
        return await self.executor.run(operation, *args, **kwargs)


@asynccontextmanager
async def open_state(
    settings: ServiceSettings, store: Store, tokens: "TokenVerifier | None"
) -> AsyncIterator[AppState]:
    """Open the shared services of an application; close them and the store at its shutdown."""
    executor, metrics = BlockingExecutor(), ServiceMetrics(store, settings.data_dir)
    blobs = open_blobs(settings)
    blobs.observe_object = metrics.observe_object
    state = AppState(
        settings=settings,
        store=store,
        blobs=blobs,
        hub=JobEventHub(store, executor),
        rate_limiter=RateLimiter(settings.rate, settings.burst),
        metrics=metrics,
        uploads=UploadAdmission(settings.max_uploads),
        executor=executor,
        outbound=make_checked_client(settings),
        tokens=tokens,
        inspection_slots=OwnerSlots(
            MAX_CONCURRENT_INSPECTIONS * count_slots(settings.max_unpacked), MAX_INSPECTIONS_PER_OWNER
        ),
    )
    try:
        yield state
    finally:
        if tokens is not None:
            await tokens.keys.close()
        await state.run_blocking(store.close)
        executor.close()


async def _get_state(request: Request) -> Any:
    # Asynchronous although it never waits: the framework runs synchronous dependencies in a thread.
    return request.app.state.islands


#: Type of a route parameter that receives the application state.
AppStateDep = Annotated[AppState, Depends(_get_state)]
