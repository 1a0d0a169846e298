"""Short and extreme records over REST: a job fails with a problem that says what to do, or it succeeds."""

from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from islands.records.writer import write_record
from islands.systems.example_records import make_piezo
from islands_service.liveness import StopRequest
from support.coordinators import SerialCoordinator
from support.processes import eventually
from support.service import QUICK, Service, columns, emptied, held, npz, spec

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
@pytest.mark.parametrize("name", ["u_V", "y_um"])
@pytest.mark.parametrize("factor", [1e300, pytest.param(1e-300, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("kind", ["jobs", "discrepancies"])
def test_a_job_on_extreme_magnitudes_fails_with_a_sentence_that_says_what_to_do(
    service: Service, kind: str, factor: float, name: str
) -> None:
    asked = spec("", settings=QUICK) if kind == "jobs" else held("", simulation={"kind": "second-order"})
    job = _run(service, f"/v1/{kind}", _scale(400, **{name: factor}), "record.npz", **asked)
    assert job["state"] == "failed"
    assert job["problem"]["type"] != "defect", job["problem"]
    assert name in job["problem"]["detail"]
    assert "use another unit" in job["problem"]["detail"]


@pytest.mark.ci
@pytest.mark.parametrize(
    "rows", ["0:36", *(pytest.param(each, marks=pytest.mark.nightly) for each in ("0:30", "0:44"))]
)
def test_a_job_on_few_samples_succeeds_or_asks_for_more(service: Service, tmp_path: Path, rows: str) -> None:
    """Models of different lags had predictions of different lengths, which the recommendation compared."""
    write_record(make_piezo(), tmp_path / "piezo.csv")
    content = (tmp_path / "piezo.csv").read_bytes()
    settings = {**QUICK, "max_height": 1}
    job = _run(
        service, "/v1/jobs", content, "piezo.csv", **spec("", preset="narx", settings=settings, rows=rows)
    )
    if job["state"] == "failed":
        assert job["problem"]["type"] == "invalid-record", job["problem"]
        assert "give" in job["problem"]["detail"]
    else:
        assert job["state"] == "succeeded"
        assert service.client.get(f"/v1/jobs/{job['id']}/models").json()["items"]


@pytest.mark.ci
def test_a_diagnosis_of_a_few_samples_says_that_they_are_too_few(service: Service) -> None:
    job = _run(service, "/v1/discrepancies", _scale(150), "record.npz", **held(""))
    assert job["state"] == "failed"
    assert job["problem"]["type"] == "invalid-record", job["problem"]
    assert "150 samples, and a diagnosis needs at least 200: give a longer one" in job["problem"]["detail"]
