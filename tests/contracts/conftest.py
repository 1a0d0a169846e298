"""Running service for the contract tests of the REST interface: one per file, emptied before every test."""

from types import SimpleNamespace

import numpy as np
import pytest

from islands_api.client import Client
from islands_api.web.routes import simulations
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.store.blobs import Blobs
from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.job_runs import make_run
from support.service import emptied, held, kept, run_identification
from support.stores import taken


@pytest.fixture(autouse=True)
def _late_simulation_server(monkeypatch):
    """Start the server of simulations, which takes seconds, with the first preview, not with their list."""
    monkeypatch.setattr(simulations, "SIMULATION_SERVER", SimpleNamespace(ensure_running=lambda: None))


@pytest.fixture(scope="module")
def shared(serve):
    with serve() as running:
        yield running


@pytest.fixture
def service(shared):
    return emptied(shared)


@pytest.fixture
def order(service):
    return held(kept(service.store))


@pytest.fixture(scope="module")
def identified(shared):
    """Return the running service, which is not emptied: the tests of a file share its jobs."""
    return shared


@pytest.fixture(scope="module")
def job(identified):
    """Return a job of a model of one output."""
    return run_identification(identified)


@pytest.fixture(scope="module")
def outputs(identified, tmp_path_factory):
    """Return a job of a model of two outputs."""
    record = make_coupled_record(TWO_MASSES, samples=200, noise=0.01)
    table = [0.1 * np.arange(200).round(3), record.records[0].u[:, 0], *record.y.T]
    path = tmp_path_factory.mktemp("masses") / "masses.csv"
    np.savetxt(path, np.transpose(table), delimiter=",", header="t_s,u,y1,y2", comments="", fmt="%.17g")
    settings = {"population": 8, "generations": 2, "max_terms": 4, "library_degree": 1, "islands": 1}
    with Client(identified.url) as client:
        found = client.submit(client.upload(path), "u", ["y1", "y2"], average=1, **settings)
    lease = taken(identified.store, found.id)
    outcome = run_identification_job(make_run(lease, identified.store, Blobs(identified.settings.blobs)))
    identified.store.leases.finish(lease, outcome)
    return found.id
