"""Jobs of several outputs: search, resumption, model, figures, report and download over REST."""

from dataclasses import replace

import httpx
import numpy as np
import pytest

import islands
from islands.report.documents.result_folder import result_document
from islands.report.text.statements import describe
from islands_api.client import Client
from islands_service.coordinator import identification_job
from islands_service.coordinator.heartbeat import CoordinatorStopping
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.domain.job import JobState, name_free_run_artefacts
from islands_service.store.blobs import Blobs
from support.command_line import succeed
from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.job_runs import Interruption, make_run
from support.shared_states import make_record
from support.stores import taken

pytestmark = pytest.mark.ci

#: A search that takes a second.
SETTINGS = {
    "population": 8,
    "generations": 2,
    "max_terms": 4,
    "library_degree": 1,
    "average": 1,
    "islands": 1,
    "preset": "narx",
}


@pytest.fixture(scope="module")
def record():
    return make_coupled_record(TWO_MASSES, samples=200, noise=0.01)


@pytest.fixture
def dataset(service, record, tmp_path):
    columns = [0.1 * np.arange(200).round(3), record.records[0].u[:, 0], *record.y.T]
    path = tmp_path / "masses.csv"
    np.savetxt(path, np.transpose(columns), delimiter=",", header="t_s,u,y1,y2", comments="", fmt="%.17g")
    with Client(service.url) as client:
        yield client.upload(path)


def run(service, job, **changes):
    blobs, lease = Blobs(service.settings.blobs), replace(taken(service.store, job.id), **changes)
    outcome = run_identification_job(make_run(lease, service.store, blobs))
    service.store.leases.finish(lease, outcome)
    return outcome


def test_a_job_has_the_model_of_the_library(service, dataset, record, tmp_path):
    with Client(service.url) as client:
        job = client.submit(dataset, "u", ["y1", "y2"], seed=3, **SETTINGS)
        run(service, job)
        done = client.job(job)
        assert done.state == JobState.SUCCEEDED
        assert client.models(job)[0].kind == "coupled-narx"
        # Both searches have three generations each.
        assert (done.progress["generation"], done.progress["generations"]) == (5, 5)
        generations = [point.generation for point in client.history(job).items]
        assert generations == sorted(set(generations))
        succeed("jobs", "show", job.id, "--url", service.url, "--out", tmp_path / "result")
        assert "y1(k) =" in succeed("jobs", "show", job.id, "--watch", "--url", service.url)
        names = name_free_run_artefacts(1, 2)
        stored = [service.store.results.artefact(job.id, name) for name in names]
        # The free run of each output, frequency response, step responses and poles.
        assert client.report(job).count(b"<img") == 5
        # The report draws the free runs that were stored with the result.
        assert stored == [service.store.results.artefact(job.id, name) for name in names]
        path = f"{service.url}/v1/jobs/{job.id}/models/1/simulation"
        first, second = (httpx.get(path, params={"output": number}, timeout=60).json() for number in (1, 2))
        assert first["measured"] != second["measured"]
        assert second["band"]["level"] == 0.9
        missing = httpx.get(path, params={"output": 3})
        assert (missing.status_code, missing.json()["detail"]) == (
            404,
            "the model has 2 outputs, there is no 3",
        )
        assert "y2" in client.export(job, 1, "c")
    files = islands.read_record(tmp_path / "masses.csv", "u", ["y1", "y2"])
    expected = islands.identify(files, seed=3, **SETTINGS)
    # The same statements over REST, on the page and from the library.
    assert done.summary["words"].splitlines() == describe(result_document(expected.search_result))
    loaded = islands.load(tmp_path / "result")
    assert loaded.best.model == expected.best.model
    np.testing.assert_array_equal(loaded.bands(files).upper, expected.bands(files).upper)
    assert sorted(path.name for path in (tmp_path / "result" / "figures").iterdir()) == [
        "free-run-1.svg",
        "free-run-2.svg",
    ]


def test_the_last_attempt_has_the_models_without_the_steps_after_them(service, dataset):
    with Client(service.url) as client:
        job = client.submit(dataset, "u", ["y1", "y2"], seed=3, **SETTINGS)
        outcome = run(service, job, is_last=True)
        assert client.models(job)[0].kind == "coupled-narx"
    reasons = {each["step"]: each["reason"] for each in outcome.document["not_computed"]}
    assert {"refinement of all equations", "prediction bands", "residual tests of y1"} < set(reasons)
    assert set(reasons.values()) == {"the attempts before the last one ended without a result"}
    assert not outcome.artefacts


def test_a_job_continues_in_the_search_that_was_interrupted(service, dataset, monkeypatch):
    monkeypatch.setattr(identification_job, "REPORT_EVERY", 0.0)
    with Client(service.url) as client:
        whole, part = (client.submit(dataset, "u", ["y1", "y2"], seed=3, **SETTINGS) for _ in range(2))
        expected = run(service, whole)
        blobs = Blobs(service.settings.blobs)
        for generation in (1, 3):
            lease = taken(service.store, part.id)
            interruption = Interruption(service.store, lease.job, generation)
            with pytest.raises(CoordinatorStopping):
                run_identification_job(make_run(lease, service.store, blobs, interruption, 0.0))
            service.store.leases.release(lease)
        assert client.job(part).progress["generation"] == 3
        found = run(service, part)
        assert found.models == expected.models
        assert client.history(part) == client.history(whole)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"output": ["y1", "y1"]}, "y1 is given twice"),
        ({"output": ["y1", "u"]}, "u is an input and an output"),
        ({"output": ["y1", "y3"]}, "y3"),
        ({"settings": {"feedthrough": "yes"}}, "as u+1"),
        ({"settings": {"constraints": "gain = 2"}}, "are for one output"),
        ({"settings": {"select": "fitness"}}, "by their free run together"),
        (
            {"model": "gain-scheduled"},
            "has one output: name one, or take the model narx with the preset latent",
        ),
    ],
)
@pytest.mark.usefixtures("toy_class")
def test_a_job_that_can_only_fail_is_refused(service, dataset, given, message):
    request = {"dataset": dataset.id, "inputs": ["u"], "output": ["y1", "y2"], **given}
    answer = httpx.post(f"{service.url}/v1/jobs", json=request)
    assert answer.status_code == 422
    assert message in answer.json()["detail"]


def test_a_state_space_that_outputs_share_is_a_model_as_any_other(service, tmp_path):
    record = make_record(3, (1.0,), 0.0, 600)
    columns = [0.01 * np.arange(600), *record.u.T, *record.y.T]
    path = tmp_path / "arm.csv"
    head = "t_s,p_V,q_V,a_m,b_m"
    np.savetxt(path, np.transpose(columns), delimiter=",", header=head, comments="", fmt="%.17g")
    with Client(service.url, timeout=120.0) as client:
        job = client.submit(
            client.upload(path), ["p_V", "q_V"], ["a_m", "b_m"], **(SETTINGS | {"preset": "auto"})
        )
        outcome = run(service, job)
        (model,) = client.models(job)
        assert model.kind == "coupled-latent"
        assert "share" in client.job(job).summary["words"]
        assert b"damping ratio" in client.report(job)
        file = tmp_path / "model.json"
        file.write_text(client.export(job, 1, "json"))
        saved, u = islands.load(file), np.sin(np.arange(60.0))
        assert saved.linearise().members
        expected = saved.simulate(np.column_stack([u, 0.5 * u])).y
        found = client.simulate(job, 1, {"p_V": u, "q_V": 0.5 * u})
        assert found.outputs == dict(zip(("a_m", "b_m"), map(tuple, expected.T.tolist()), strict=True))
        assert "y2" in client.export(job, 1, "c")
        succeed("jobs", "show", job.id, "--url", service.url, "--out", tmp_path / "arm")
        assert islands.load(tmp_path / "arm").best.model == saved.model
        assert outcome.summary["size"] < saved.model.size  # without the coordinates of the states
