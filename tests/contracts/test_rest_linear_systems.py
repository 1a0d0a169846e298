"""Linear systems of the models of a job over REST: the numbers of the library, figures, and problems."""

import asyncio
import json

import numpy as np
import pytest

from islands.export.linear_system import write_linear_system
from islands.models.state_space import FORMS
from islands.report.figures.names import LINEAR_FIGURES
from islands_api.client import AsyncClient, Client
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.domain.fitted_models import read_fitted
from islands_service.store.blobs import Blobs
from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.job_runs import make_run
from support.service import problem_of, run_identification
from support.stores import taken

pytestmark = pytest.mark.ci

#: Seconds for a request that draws figures in another process.
PATIENCE = 300.0


@pytest.fixture(scope="module")
def service(serve):
    with serve() as running:
        yield running


@pytest.fixture(scope="module")
def job(service):
    return run_identification(service)


@pytest.fixture(scope="module")
def outputs(service, tmp_path_factory):
    """Job of a model of two outputs."""
    record = make_coupled_record(TWO_MASSES, samples=200, noise=0.01)
    table = [0.1 * np.arange(200).round(3), record.records[0].u[:, 0], *record.y.T]
    path = tmp_path_factory.mktemp("masses") / "masses.csv"
    np.savetxt(path, np.transpose(table), delimiter=",", header="t_s,u,y1,y2", comments="", fmt="%.17g")
    settings = {"population": 8, "generations": 2, "max_terms": 4, "library_degree": 1, "islands": 1}
    with Client(service.url) as client:
        found = client.submit(client.upload(path), "u", ["y1", "y2"], average=1, **settings)
    lease = taken(service.store, found.id)
    outcome = run_identification_job(make_run(lease, service.store, Blobs(service.settings.blobs)))
    service.store.leases.finish(lease, outcome)
    return found.id


def linearise(service, job, *point):
    (stored,) = service.store.results.models(job, 1)
    document = service.store.results.document(job)
    return read_fitted(job, stored.file, stored.document, document).linearise(*point)


def test_the_system_is_that_of_the_library_in_every_notation(service, job, outputs):
    with Client(service.url) as client:
        for each in (job, outputs):
            system = linearise(service, each)
            for form in FORMS:
                for notation in ("json", "matlab", "text"):
                    written = client.export_linear_system(each, 1, form=form, notation=notation)
                    assert written == write_linear_system(system, form, notation)
            found = client.linear_system(each)
            assert np.array_equal(found.A, system.A)
            assert np.array_equal(found.static_gain, system.static_gain)
            assert found.words == system.describe()
            assert found.numerators is None


def test_a_system_is_about_a_given_operating_point(service, job):
    with Client(service.url) as client:
        found = client.linear_system(job, at={"u_V": 0.25}, form="transfer-function")
    assert found.operating_inputs == (0.25,)
    expected = linearise(service, job, {"u_V": 0.25}).transfer_functions()
    assert np.array_equal(found.numerators, expected[0])
    with Client(service.url) as client:
        found = client.linear_system(job, continuous="tustin")
        written = client.export_linear_system(job, continuous="tustin")
    expected = linearise(service, job).to_continuous("tustin")
    assert (found.dt, np.array_equal(found.A, expected.A)) == (0.0, True)
    assert written == write_linear_system(expected, "state-space", "matlab")
    answer = service.client.get(f"/v1/jobs/{job}/models/1/linear-system", params={"continuous": "foh"})
    assert "there is no conversion 'foh'" in problem_of(answer, 422, "invalid-settings")
    for text, detail in (("u_V", "NAME=VALUE"), ("u_V=nan", "NAME=VALUE"), ("w=1", "no input w")):
        answer = service.client.get(f"/v1/jobs/{job}/models/1/linear-system", params={"at": text})
        kind = "invalid-model" if "input" in detail else "invalid-settings"
        assert detail in problem_of(answer, 422, kind)


@pytest.mark.parametrize("several", [False, True])
def test_all_figures_of_an_operating_point_are_drawn_once(service, job, outputs, several, monkeypatch):
    which, drawn = outputs if several else job, []
    from islands_api.web.routes import linear_systems

    run = linear_systems.run_figure_worker

    async def count(*arguments):
        drawn.append(arguments[2])
        return await run(*arguments)

    monkeypatch.setattr(linear_systems, "run_figure_worker", count)
    with Client(service.url, timeout=PATIENCE) as client:
        pictures = {name: client.linear_figure(which, name) for name in LINEAR_FIGURES}
        assert all(picture.startswith(b"<?xml") for picture in pictures.values())
        assert len(set(pictures.values())) == len(LINEAR_FIGURES)
        table = client.linear_figure(which, "bode", form="csv").decode()
    assert len(drawn) == 1
    assert json.loads(drawn[0][-1].partition("=")[2]) == {}
    assert len(table.splitlines()) > 100


def test_the_asynchronous_client_has_the_same_calls(service, job):
    async def ask():
        async with AsyncClient(service.url, timeout=PATIENCE) as client:
            return await client.linear_system(job), await client.export_linear_system(job)

    system, text = asyncio.run(ask())
    assert system.outputs == ("y_um",)
    assert "sys = ss(A, B, C, D, 0.01);" in text
