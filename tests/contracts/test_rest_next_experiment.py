"""Input of the next experiment of a diagnosis over REST."""

import csv
from io import StringIO

import numpy as np
import pytest

from islands_service.coordinator.diagnosis_job import run_diagnosis_job
from islands_service.domain.job import JobOutcome, JobState
from islands_service.store.blobs import Blobs
from support.job_runs import make_run
from support.service import problem_of

pytestmark = pytest.mark.ci

DT = 0.01

#: An amplifier as a model of one term, which is a sample late.
AMPLIFIER = {
    "schema": "islands.model/1",
    "inputs": ["u_V"],
    "output": "y_um",
    "terms": [{"regressor": "u(k-1)", "parameter": 2.0}],
}


def make_record() -> bytes:
    """Make a slow record of an amplifier with a delay, which a lag explains as well."""
    t = DT * np.arange(1000)
    u = np.sin(2 * np.pi * 0.25 * t) + 0.3 * np.sin(2 * np.pi * 0.4 * t)
    y = 2.0 * np.interp(t - 0.03, t, u) + 0.05 * np.random.default_rng(1).standard_normal(t.size)
    rows = (f"{a:.2f},{b:.6f},{c:.6f}\n" for a, b, c in zip(t, u, y, strict=True))
    return ("t_s,u_V,y_um\n" + "".join(rows)).encode()


def submit(service) -> str:
    dataset = service.upload(make_record()).json()["id"]
    order = {"dataset": dataset, "input": "u_V", "output": "y_um"}
    simulation = {"kind": "model", "model": AMPLIFIER, "name": "amplifier"}
    return str(
        service.client.post("/v1/discrepancies", json={**order, "simulation": simulation}).json()["id"]
    )


@pytest.fixture(scope="module")
def finished(serve):
    """A service with a finished diagnosis whose cause has equivalents, and the id of the job."""
    with serve() as running:
        job = submit(running)
        lease = running.store.leases.claim("test", 600.0)
        outcome = run_diagnosis_job(
            make_run(lease, running.store, Blobs(running.settings.blobs)), map_cases=map
        )
        running.store.leases.finish(lease, outcome)
        yield running, job


def test_the_file_has_the_column_the_sampling_time_and_the_limits_of_the_result(finished):
    service, job = finished
    found = service.client.get(f"/v1/jobs/{job}/result").json()["next_experiment"]
    assert ["delay", "sensor-lag"] in [pair["causes"] for pair in found["pairs"]]
    answer = service.client.get(f"/v1/jobs/{job}/next-experiment")
    assert answer.headers["content-type"] == "text/csv; charset=utf-8"
    assert answer.headers["content-disposition"] == f'attachment; filename="next-experiment-{job[:8]}.csv"'
    names, *rows = csv.reader(StringIO(answer.text))
    assert names == ["t_s", "u_V"]
    t, u = np.array(rows, dtype=float).T
    described = found["input"]
    assert u.size == described["samples"]
    assert np.diff(t) == pytest.approx(DT)
    assert (u.min(), u.max()) == (described["limits"]["lower"], described["limits"]["upper"])
    assert np.abs(np.diff(u)).max() / DT == pytest.approx(described["limits"]["rate"])
    assert described["is_within_record"] == (max(described["range_excess"], described["rate_excess"]) <= 1.0)
    assert any(pair["predicted"]["is_sufficient"] for pair in found["pairs"])


def test_a_result_without_the_input_says_why(service):
    job = submit(service)
    lease = service.store.leases.claim("test", 600.0)
    result = {"verdict": "nothing", "next_experiment": None}
    service.store.leases.finish(lease, JobOutcome(JobState.SUCCEEDED, result))
    detail = problem_of(service.client.get(f"/v1/jobs/{job}/next-experiment"), 404, "not-found")
    assert "tells its causes apart" in detail
