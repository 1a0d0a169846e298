"""Metrics of a coordinator: attempts, outcomes and durable writes of real jobs."""

from math import inf
from threading import Thread
from typing import Any

import pytest

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.problem import Problem
from islands_service.coordinator.heartbeat import Heartbeat
from islands_service.coordinator.job_run import JobNotes, JobRun
from islands_service.domain.job import IDENTIFICATION, Job, JobOutcome, JobState
from islands_service.liveness import StopRequest
from islands_service.runtime import actor_pool, cluster, ray_engine
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from support.coordinators import (
    DONE,
    RayCoordinator,
    SerialCoordinator,
    replace_runner,
    wait_until_finished,
)
from support.searches import SMALL, record
from support.stores import claimed


def test_metrics_count_attempts_outcomes_and_writes(
    store: Store, job: Job, settings: ServiceSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    attempts: list[Any] = []

    def fail_once(run: JobRun) -> JobOutcome:
        attempts.append(run.blobs.write(b"a checkpoint"))
        if len(attempts) == 1:
            raise OSError("the network was away")
        return DONE

    replace_runner(monkeypatch, fail_once)
    monkeypatch.setattr("islands_service.coordinator.main_loop.RETRY_BACKOFF", 0.01)
    stopping = StopRequest()
    coordinator = SerialCoordinator(settings, "me", stopping)
    thread = Thread(target=coordinator.run)
    thread.start()
    try:
        assert wait_until_finished(store, job).state == JobState.SUCCEEDED
    finally:
        stopping.request()
        thread.join()
    read = coordinator._metrics.registry.get_sample_value
    assert read("islands_attempts_total", {"kind": IDENTIFICATION}) == 2.0
    assert read("islands_jobs_finished_total", {"kind": IDENTIFICATION, "state": "succeeded"}) == 1.0
    assert read("islands_attempts_given_back_total", {"reason": "interrupted"}) == 1.0
    assert read("islands_coordinator_busy") == 0.0
    assert read("islands_blob_write_seconds_count") == 2.0
    assert (read("islands_store_commit_seconds_count") or 0.0) >= 4.0  # two claims, a return and an outcome


def test_islands_with_and_without_a_separate_cpu_are_metrics(
    store: Store, job: Job, settings: ServiceSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    engines: list[Any] = []

    def make_engine(*arguments: Any) -> SerialEngine:
        engines.append(arguments)
        return SerialEngine()

    monkeypatch.setattr(actor_pool, "kill_stale_actors", lambda *_: 0)
    monkeypatch.setattr(cluster, "cluster_memory", lambda: inf)
    monkeypatch.setattr(ray_engine, "RayEngine", make_engine)
    coordinator = RayCoordinator(settings, "me", StopRequest())
    lease = claimed(store)
    heartbeat = Heartbeat(store, lease, 60.0, StopRequest())
    engine = coordinator._make_engine(lease, lambda: None, JobNotes(lease, store), heartbeat)
    next(engine.run(Problem(record(), SMALL), empty_archipelago(1, 0), lambda: False))
    read = coordinator._metrics.registry.get_sample_value
    assert (read("islands_running_islands"), read("islands_pending_islands")) == (0.0, 0.0)
    engines[0][-1](2, 6)
    assert (read("islands_running_islands"), read("islands_pending_islands")) == (2.0, 6.0)
