"""Short searches run in the coordinator, without Ray: they survive the same faults as those on actors."""

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from islands.evolution.engine import SerialEngine
from islands.facade.identify import identify
from islands.records.reading import read_record
from islands.report.documents.result_folder import result_document
from support.service_client import SPEC
from support.service_processes import Service, serving

#: Generations of a search of one or two seconds.
GENERATIONS = 300

SHORT = {"ISLANDS_SHORT_SEARCH": "5"}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with serving(tmp_path_factory.mktemp("short") / "data", environment=SHORT) as running:
        yield running


@pytest.fixture(scope="module")
def models(service: Service) -> list[Any]:
    """Models of the search in one undisturbed process."""
    assert service.dataset
    record = read_record(service.folder.with_suffix(".csv"), SPEC["inputs"], SPEC["output"])
    settings = {**SPEC["settings"], "generations": GENERATIONS}
    found = identify(record, preset="hysteresis", seed=SPEC["seed"], engine=SerialEngine(), **settings)
    parsed: list[Any] = json.loads(json.dumps(result_document(found.search_result)["models"]))
    return parsed


def under_way(service: Service) -> str:
    """Submit a job; return its id during the epochs of its search, which no process of Ray computes."""
    job = service.submit(GENERATIONS, preset="hysteresis")
    assert service.under_way(job) < GENERATIONS
    assert not any(service.pids(role) for role in ("head", "raylet", "island"))
    return job


def find_models(service: Service, job: str) -> Any:
    return json.loads(service.found(job))["items"]


@pytest.mark.ci
@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.nightly)])
def test_coordinator_lost_during_a_short_search_loses_no_job(
    service: Service, models: list[Any], number: signal.Signals
) -> None:
    job = under_way(service)
    os.kill(service.one("coordinator"), number)
    assert find_models(service, job) == models
    assert service.job(job)["attempt"] == 2


@pytest.mark.nightly
def test_short_search_continues_after_a_restart_of_the_service(models: list[Any], tmp_path: Path) -> None:
    with serving(tmp_path / "data", environment=SHORT) as first:
        job = under_way(first)
        assert first.stop() == 0
    with serving(tmp_path / "data", environment=SHORT) as second:
        assert second.job(job)["state"] in ("queued", "running")
        assert find_models(second, job) == models
