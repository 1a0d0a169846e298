"""`JobEngine`: a short search needs no cluster, and a long one connects to it before its first epoch."""

from dataclasses import replace
from math import inf
from typing import Any

import pytest

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.problem import Problem
from islands_service.coordinator import job_engine
from islands_service.coordinator.job_engine import JobEngine, estimate_seconds, expects_cluster
from islands_service.coordinator.job_failures import make_problem_document
from islands_service.domain.job import DISCREPANCY, MONITORING, Lease
from islands_service.domain.search_limits import ACTOR_BYTES, COORDINATOR_BYTES, JobMemoryError
from islands_service.runtime import cluster
from islands_service.store import Store
from support.searches import SMALL, record
from support.service import held, spec
from support.stores import submitted

PROBLEM = Problem(record(), replace(SMALL, islands=2))
SECONDS = estimate_seconds(PROBLEM.settings, PROBLEM.record.samples)


class ConnectionRequestedError(Exception):
    """Ends a search that needs the cluster."""


def request_connection() -> None:
    raise ConnectionRequestedError


def make_engine(store: Store, short: float, connect: Any = request_connection) -> JobEngine:
    lease = Lease(submitted(store), 1)
    return JobEngine(lease, short, connect, lambda *_: None, False, lambda *_: None)


def run(engine: Any, problem: Problem = PROBLEM) -> list[str]:
    start = empty_archipelago(problem.settings.islands, 3)
    return [repr(epoch.archipelago) for epoch in engine.run(problem, start, lambda: False)]


def test_short_search_runs_without_a_cluster_and_gives_the_same_islands(store: Store) -> None:
    assert run(make_engine(store, SECONDS)) == run(SerialEngine())


def test_search_needs_the_memory_of_the_cluster(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """A job that was accepted does not start on a cluster that is too small for it."""
    individuals = 2 * SMALL.population
    monkeypatch.setattr(cluster, "cluster_memory", lambda: individuals * ACTOR_BYTES - 1)
    with pytest.raises(JobMemoryError, match="2 islands of 24 individuals") as error:
        run(make_engine(store, 0.0, lambda: None))
    assert make_problem_document(error.value)["type"] == "insufficient-memory"


def test_short_search_needs_the_memory_of_this_machine(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job_engine, "machine_memory", lambda: 48 * COORDINATOR_BYTES)
    with pytest.raises(JobMemoryError):
        run(make_engine(store, inf))


@pytest.mark.parametrize(
    ("changes", "samples", "expected"),
    [
        ({"settings": {"islands": 1, "population": 20, "generations": 1}}, 500, False),
        ({"settings": {"islands": 2, "population": 500, "generations": 500}}, 500, True),
        ({"settings": {"islands": 2, "population": 100, "generations": 99}}, 2_000, False),
        ({"settings": {"islands": 2, "population": 100, "generations": 99}}, 200_000, True),
        ({"preset": "auto"}, 2_000, False),
        ({"preset": "auto"}, 10_000_000, True),
        ({"model": "gain-scheduled", "preset": "auto"}, 10_000_000, False),
    ],
)
def test_need_of_a_cluster_is_known_before_the_record_is_read(
    store: Store, changes: dict[str, Any], samples: int, expected: bool
) -> None:
    job = submitted(store, spec=spec("set", **changes))
    assert expects_cluster(job, samples, 5.0) is expected


def test_diagnosis_needs_a_cluster_and_monitoring_does_not(store: Store) -> None:
    assert expects_cluster(submitted(store, spec=held("set"), kind=DISCREPANCY), 500, inf)
    assert not expects_cluster(submitted(store, spec={}, kind=MONITORING), 10**9, 0.0)
