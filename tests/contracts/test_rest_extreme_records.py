"""Short and extreme records over REST: a job fails with a problem that says what to do, or it succeeds."""

from collections.abc import Iterator
from threading import Thread
from typing import Any

import pytest

from islands_service.liveness import StopRequest
from support.coordinators import SerialCoordinator
from support.processes import eventually
from support.service import Service, columns, emptied, held, npz

#: Seconds that a job may take.
_PATIENCE = 240.0


@pytest.fixture(scope="module")
def coordinated(serve: Any) -> Iterator[Service]:
    """A service with a coordinator, whose engine is serial."""
    with serve() as service:
        stopping = StopRequest()
        coordinator = Thread(target=SerialCoordinator(service.settings, "coordinator", stopping).run)
        coordinator.start()
        service.client.timeout = _PATIENCE  # compilation in the thread of the coordinator blocks the service
        try:
            yield service
        finally:
            stopping.request()
            coordinator.join(10.0)


@pytest.fixture
def service(coordinated: Service) -> Service:
    return emptied(coordinated)


def _run(service: Service, path: str, content: bytes, name: str, **asked: Any) -> dict[str, Any]:
    """Upload a record, submit a job and return it once it has finished."""
    uploaded = service.upload(content, name)
    assert uploaded.status_code == 201, uploaded.text
    answer = service.client.post(path, json={**asked, "dataset": uploaded.json()["id"]})
    assert answer.status_code == 202, answer.text
    location = f"/v1/jobs/{answer.json()['id']}"
    eventually(lambda: _read(service, location)["state"] not in ("queued", "running"), seconds=_PATIENCE)
    return _read(service, location)


def _read(service: Service, location: str) -> dict[str, Any]:
    job: dict[str, Any] = service.client.get(location).json()
    return job


def _scale(samples: int = 200, **factors: float) -> bytes:
    """Return a record whose columns are multiplied by factors."""
    values = columns(samples)
    return npz(**{name: factors.get(name, 1.0) * column for name, column in values.items()})


@pytest.mark.ci
def test_a_diagnosis_of_a_few_samples_says_that_they_are_too_few(service: Service) -> None:
    job = _run(service, "/v1/discrepancies", _scale(150), "record.npz", **held(""))
    assert job["state"] == "failed"
    assert job["problem"]["type"] == "invalid-record", job["problem"]
    assert "150 samples, and a diagnosis needs at least 200: give a longer one" in job["problem"]["detail"]
