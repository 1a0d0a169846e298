"""Jobs of a class of models that is not NARX: fit, models, exports, simulation and diagnosis over REST."""

import json

import numpy as np
import pytest

import islands
from islands_api.client import Client
from islands_api.client.responses import ServiceError
from islands_api.web.auth import LOCAL_OWNER
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.domain.job import REPORT, JobState
from islands_service.figure_worker import read_search_result, render_figures, render_model_figures
from islands_service.store.blobs import Blobs
from support.command_line import succeed
from support.gain_scheduled import TRUE, GainScheduledModel, make_record
from support.job_runs import make_run
from support.latent_systems import spring_record
from support.stores import LONG, taken

pytestmark = [pytest.mark.ci, pytest.mark.usefixtures("toy_class")]


@pytest.fixture
def dataset(service, tmp_path):
    islands.write_record(make_record(), tmp_path / "oven.csv")
    with Client(service.url) as client:
        yield client.upload(tmp_path / "oven.csv")


def test_a_job_of_a_class_has_the_model_and_its_exports(service, dataset):
    with Client(service.url) as client:
        job = client.submit(dataset, "u_V", "y_K", model="gain-scheduled", refit="all")
        blobs, lease = Blobs(service.settings.blobs), taken(service.store, job.id)
        outcome = run_identification_job(make_run(lease, service.store, blobs, lambda: None, LONG))
        service.store.leases.finish(lease, outcome)
        assert client.job(job).state == JobState.SUCCEEDED
        (model,) = (each for each in client.models(job) if each.kind == "gain-scheduled")
        assert model.refit["discarded"] is None
        document = json.loads(client.export(job, model.rank, "json"))
        found = GainScheduledModel.read(document, "model")
        np.testing.assert_allclose(found.parameters, TRUE, rtol=0.01)
        assert "predict_x1" in client.export(job, model.rank, "c")
        # The worker is another process, which does not have the class of this test.
        stored = service.store.jobs.get(LOCAL_OWNER, job.id)
        rebuilt = read_search_result(stored, service.store, blobs, model.rank)
        drawn = render_model_figures(rebuilt, model.rank)
        assert {"1/free-run.svg", "1/free-run.json"} <= drawn.keys()
        made = render_figures(stored, rebuilt)
        assert b"x1(k)" in made[REPORT]
        figures = service.client.get(f"/v1/jobs/{job.id}/figures").json()["items"]
        assert figures == ["record", "front"]
        assert {f"{name}.svg" for name in figures} <= made.keys()
        assert "slope = -0." in succeed("jobs", "show", job.id, "--watch", "--url", service.url)
        # The model is a simulation of a diagnosis.
        simulation = {"kind": "model", "model": document}
        assert client.diagnose(dataset, "u_V", "y_K", simulation).state == JobState.QUEUED


def test_a_latent_model_has_the_constraints_of_its_job(service, tmp_path):
    islands.write_record(spring_record(300, noise=0.02), tmp_path / "spring.csv")
    with Client(service.url) as client:
        dataset = client.upload(tmp_path / "spring.csv")
        searched = {"preset": "latent", "population": 6, "generations": 1, "islands": 1}
        job = client.submit(dataset, "u_V", "y_mm", **searched, constraints="gain = 0.564")
        other = client.submit(dataset, "u_V", "y_mm", **searched, constraints="fixed-point = 0, 0.3")
        blobs = Blobs(service.settings.blobs)
        for each, value in ((job, 0.564), (other, 0.3)):
            lease = taken(service.store, each.id)
            outcome = run_identification_job(make_run(lease, service.store, blobs, lambda: None, LONG))
            service.store.leases.finish(lease, outcome)
            for model in client.models(each):
                (check,) = model.constraints
                assert check["met"]
                assert check["value"] == pytest.approx(value, rel=1e-9)
            rebuilt = read_search_result(
                service.store.jobs.get(LOCAL_OWNER, each.id), service.store, blobs, 1
            )
            assert all(check.met for check in rebuilt.models[0].constraints)
        for given in ({"model": "latent"}, {"preset": "latent"}):
            with pytest.raises(ServiceError, match="Statements about latent models are gain"):
                client.submit(dataset, "u_V", "y_mm", **given, constraints="[u(k-1)] = 1")
            with pytest.raises(ServiceError, match="2 inputs, but the record has 1"):
                client.submit(dataset, "u_V", "y_mm", **given, constraints="gain(u2) = 1")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"model": "gain"}, "unknown class of models"),
        ({"model": "gain-scheduled", "settings": {"generations": 3}}, "leave them out"),
        ({"model": "gain-scheduled", "settings": {"refit": "every"}}, "refit is one of none, all"),
    ],
)
def test_an_unknown_class_and_settings_of_a_search_are_refused(service, dataset, given, message):
    body = {"dataset": dataset.id, "inputs": ["u_V"], "output": "y_K", **given}
    answer = service.client.post("/v1/jobs", json=body)
    assert answer.status_code == 422
    assert message in answer.json()["detail"]
