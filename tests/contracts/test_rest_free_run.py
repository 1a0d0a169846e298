"""Free run of the best model of a running search over REST."""

import numpy as np
import pytest

from islands_api.client import Client
from islands_service.coordinator import identification_job
from islands_service.coordinator.heartbeat import CoordinatorStopping
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.store.blobs import Blobs
from support.job_runs import Interruption, make_run
from support.service import columns, csv, problem_of
from support.stores import LONG, taken

pytestmark = pytest.mark.ci

SETTINGS = {"population": 10, "generations": 5, "max_terms": 3, "shooting": 50, "max_height": 3, "islands": 2}


def run(service, job, check=lambda: None):
    blobs, lease = Blobs(service.settings.blobs), taken(service.store, job.id)
    return lease, run_identification_job(make_run(lease, service.store, blobs, check, LONG))


def test_a_running_search_has_the_free_run_of_its_best_model(service, tmp_path, monkeypatch):
    monkeypatch.setattr(identification_job, "REPORT_EVERY", 0.0)
    path = tmp_path / "record.csv"
    path.write_bytes(csv(400))
    with Client(service.url) as client:
        job = client.submit(client.upload(path), "u_V", "y_um", preset="narx", average=1, **SETTINGS)
        address = f"/v1/jobs/{job.id}/free-run"
        detail = problem_of(service.client.get(address), 404, "not-found")
        assert "is queued and has no free run of a search: wait" in detail
        with pytest.raises(CoordinatorStopping):
            run(service, job, Interruption(service.store, service.store.jobs.get("local", job.id), 2))
        found = client.free_run(job)
        assert (found.job, found.output, found.outcome) == (job.id, "y_um", "ok")
        assert found.samples == 300
        measured, simulated = found.outputs
        np.testing.assert_allclose(measured.minimum, columns(400)["y_um"][:300], rtol=1e-5, atol=2e-6)
        assert len(simulated.maximum) == len(found.rows) == 300
        progress = service.store.jobs.get("local", job.id).progress
        assert progress["free_run"]["size"] in [each["size"] for each in progress["front"]]
        service.store.jobs.cancel("local", job.id)
