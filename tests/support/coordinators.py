"""Coordinators in a thread of the test."""

import time
from collections.abc import Callable
from types import MappingProxyType
from typing import Any

import pytest

from islands.evolution.engine import SerialEngine
from islands_service.coordinator import main_loop as coordinator_module
from islands_service.coordinator.job_run import JobRun
from islands_service.coordinator.main_loop import Coordinator
from islands_service.domain.job import Job, JobOutcome, JobState
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from support.processes import eventually
from support.stores import ALICE


class SerialCoordinator(Coordinator):
    """A coordinator without Ray: its engine is serial."""

    def _make_engine(self, *_: object) -> SerialEngine:  # type: ignore[override]
        return SerialEngine()


class RayCoordinator(Coordinator):
    """A coordinator that runs every search on Ray."""

    def __init__(self, settings: ServiceSettings, *arguments: Any, **options: Any) -> None:
        super().__init__(settings.model_copy(update={"short_search": 0.0}), *arguments, **options)


def wait_until_finished(store: Store, job: Job) -> Job:
    eventually(lambda: store.jobs.get(ALICE, job.id).finished is not None, seconds=30.0)
    return store.jobs.get(ALICE, job.id)


def replace_runner(monkeypatch: pytest.MonkeyPatch, how: Callable[[JobRun], JobOutcome]) -> None:
    """Replace the runner of identification jobs."""
    monkeypatch.setattr(coordinator_module, "JOB_RUNNERS", MappingProxyType({"identification": how}))
    monkeypatch.setattr(coordinator_module, "RETRY_SECONDS", 0.02)


DONE = JobOutcome(JobState.SUCCEEDED, {}, (), {"done": True})


def run_until_check_raises(run: JobRun) -> JobOutcome:
    while True:
        run.check()
        time.sleep(0.01)
