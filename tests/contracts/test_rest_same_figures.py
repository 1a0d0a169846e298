"""A model with preprocessing has the same figures over REST, in its downloaded folder and in a monitor."""

import numpy as np
import pytest

from islands.persistence.models import model_from_json
from islands.report.text.facts import BEFORE_REFIT
from islands.validation.metrics import metrics
from islands_api.client import Client
from islands_api.web.auth import LOCAL_OWNER
from islands_api.web.routes import figures
from islands_api.web.routes.figures import FigureError
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.domain.job import REPORT
from islands_service.figure_worker import read_search_result, render_figures
from islands_service.store.blobs import Blobs
from support.job_runs import make_run
from support.stores import LONG, taken

pytestmark = pytest.mark.ci

COLUMNS = ("u_V", "y_um")

#: A search of a second.
SMALL = {"population": 10, "generations": 3, "max_terms": 3, "shooting": 50, "max_height": 3, "islands": 2}

#: Seconds for a request that draws figures in another process.
PATIENCE = 300.0


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Record of a system of the first order with offsets, 100 samples a second."""
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(-1.0, 1.0, 60), 20)
    y = np.zeros(len(u))
    for k in range(1, len(u)):
        y[k] = 0.95 * y[k - 1] + 0.1 * u[k - 1]
    y += rng.normal(scale=0.02, size=len(y))
    table = np.column_stack([0.01 * np.arange(len(u)), u + 3.0, y + 40.0])
    folder = tmp_path_factory.mktemp("record") / "records"
    folder.mkdir()
    np.savetxt(folder / "r.csv", table, "%.8f", ",", header="t_s,u_V,y_um", comments="")
    return folder / "r.csv"


@pytest.fixture
def client(service):
    with Client(service.url, timeout=PATIENCE) as connected:
        yield connected


def search(service, client, dataset, **settings) -> str:
    """Run a job in this process; return its id."""
    job = client.submit(dataset, *COLUMNS, preset="narx", **SMALL, **settings)
    blobs, lease = Blobs(service.settings.blobs), taken(service.store, job.id)
    outcome = run_identification_job(make_run(lease, service.store, blobs, lambda: None, LONG))
    service.store.leases.finish(lease, outcome)
    return job.id


def test_free_run_of_the_recommended_model_needs_no_other_process(service, client, path, monkeypatch):
    job = search(service, client, client.upload(path))

    async def refuse(*_arguments):
        raise FigureError("no process may start")

    monkeypatch.setattr(figures, "run_figure_worker", refuse)
    summary = client.job(job).summary
    shown = service.client.get(f"/v1/jobs/{job}/models/{summary['rank']}/simulation")
    assert shown.status_code == 200, shown.text
    measured, simulated = (np.array(shown.json()[name], dtype=float) for name in ("measured", "free_run"))
    assert metrics(measured, simulated).rmse == pytest.approx(summary["metrics"]["rmse"])


def test_errors_and_figures_of_a_job_belong_to_the_model_before_its_refit(service, client, path):
    job = search(service, client, client.upload(path), refit="all")
    blobs, entries = Blobs(service.settings.blobs), service.store.results.models(job, None)
    stored = service.store.jobs.get(LOCAL_OWNER, job)
    rebuilt = read_search_result(stored, service.store, blobs, None)
    assert any(entry.refit and not entry.refit.discarded for entry in rebuilt.models)
    for entry, kept in zip(rebuilt.models, entries, strict=True):
        assert entry.final_model == model_from_json(kept.file)
        assert entry.validation_error == kept.document["metrics"]["validation"]["free_run"]["rmse"]
    summary = client.job(job).summary
    shown = service.client.get(f"/v1/jobs/{job}/models/{summary['rank']}/simulation").json()
    measured, simulated = (np.array(shown[name], dtype=float) for name in ("measured", "free_run"))
    assert metrics(measured, simulated).rmse == pytest.approx(summary["metrics"]["rmse"])
    assert "Refit: the parameters were estimated again on all 1200 samples" in summary["words"]
    assert BEFORE_REFIT.encode() in render_figures(stored, rebuilt)[REPORT]
