"""Simulated coordinator: a test reports progress step by step, so that the page shows every state."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import sqrt
from typing import Any

from islands_service.coordinator.identification_job import run_identification_job
from islands_service.domain.job import Lease, ProgressReport
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from support.job_runs import make_run
from support.service_client import ServiceClient
from support.stores import LONG, taken

GENERATIONS = 500


@contextmanager
def stored(service: ServiceClient) -> Iterator[Store]:
    """Open the store of a service."""
    with Store(f"sqlite:///{service.folder / 'islands.db'}") as store:
        yield store


def squared_error(generation: int, island: int) -> float:
    """Return a mean squared error that decreases like that of a search."""
    return 1e-3 * (1 + island) / (1 + generation / 20)


def advance(store: Store, lease: Lease, first: int, last: int, islands: int = 2, model: str = "narx") -> None:
    """Report all generations from ``first`` to ``last``."""
    points = tuple(
        (
            at,
            60 * (at + 1),
            {str(size): squared_error(at, 0) * 2 ** (5 - size) for size in range(1, 6)},
            tuple(squared_error(at, island) for island in range(islands)),
        )
        for at in range(first, last + 1)
    )
    front = [
        {
            "size": size,
            "error": sqrt(squared_error(last, 0) * 2 ** (5 - size)),
            "equation": "y_um(k) = " + " + ".join(f"{last}*y_um(k-{lag})" for lag in range(1, size + 1)),
        }
        for size in range(1, 6)
    ]
    progress: dict[str, Any] = {
        "phase": "search",
        "model": model,
        "generation": last,
        "generations": GENERATIONS,
        "evaluations": 60 * (last + 1),
        "evaluations_per_second": 3000.0,
        "seconds_left": (GENERATIONS - last) / 50,
        "best_error": sqrt(squared_error(last, 0)),
        "best_by_size": {each["size"]: each["error"] for each in front},
        "front": front,
        "islands": [sqrt(squared_error(last, island)) for island in range(islands)],
    }
    if last > 0 and islands > 1:
        sources = [[(island - 1) % islands] for island in range(islands)]
        progress["migration"] = {"generation": last, "emigrants": 1, "sources": sources}
    store.leases.report(lease, ProgressReport(progress, points, after=first - 1))


def run_submitted(service: ServiceClient, job: str) -> str:
    """Run an identification that was submitted to a service without coordinators; return its id."""
    with stored(service) as store:
        lease = taken(store, job)
        blobs = Blobs(ServiceSettings(data_dir=service.folder).blobs)
        outcome = run_identification_job(make_run(lease, store, blobs, lambda: None, LONG))
        store.leases.finish(lease, outcome)
    return job
