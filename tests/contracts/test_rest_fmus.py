"""FMUs over REST: upload, list, deletion, previews and diagnoses."""

import io
import zipfile

import numpy as np
import pytest
import scipy

from islands_api import Client
from support.oscillator_fmus import write_oscillator
from support.service import execute_diagnosis, npz, problem_of

pytestmark = pytest.mark.ci

ABSENT = f"{'0' * 32}-fmu"


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    return write_oscillator(tmp_path_factory.mktemp("fmu") / "mass.fmu", resources=True).read_bytes()


@pytest.fixture(scope="module")
def shared(serve):
    with pytest.MonkeyPatch.context() as patch:
        # The coordinator and the server of the simulations read it.
        patch.setenv("ISLANDS_ALLOW_FMUS", "true")
        with serve(allow_fmus=True) as running:
            yield running


def make_axis(offset=0.0, samples=240):
    """Return a record of the law of the FMU with another mass, noise, and an offset that the FMU lacks."""
    t = 0.01 * np.arange(samples)
    rng = np.random.default_rng(1)
    u = 10.0 * np.sin(3.0 * t) + rng.standard_normal(samples)
    law = scipy.signal.StateSpace(
        [[0.0, 1.0], [-200.0 / 0.55, -4.0 / 0.55]], [[0.0], [1.0 / 0.55]], [1, 0], 0
    )
    x = scipy.signal.lsim(law, u, t)[1] + 2e-4 * rng.standard_normal(samples)
    return npz(t_s=t, F_N=u, x_m=x + offset)


@pytest.fixture(scope="module")
def dataset(shared):
    return shared.upload(make_axis(), "axis.npz").json()["id"]


def send(service, content, name="mass.fmu"):
    return service.client.post("/v1/fmus", files={"file": (name, content)}, timeout=120.0)


@pytest.fixture
def fmu(shared, content):
    return send(shared, content).json()["id"]


def of_fmu(dataset, fmu, **changes):
    simulation = {"kind": "fmu", "file": fmu, "input": "u", "output": "x", **changes}
    return {"dataset": dataset, "input": "F_N", "output": "x_m", "simulation": simulation}


def test_an_fmu_is_described_and_listed_and_the_same_bytes_are_the_same_fmu(shared, content, fmu):
    again = send(shared, content, "other.fmu")
    assert (again.status_code, again.json()["id"]) == (200, fmu)
    found = shared.client.get(f"/v1/fmus/{fmu}").json()
    assert (found["name"], found["fmi"], found["interface"]) == ("mass.fmu", 3, "model-exchange")
    assert [each["name"] for each in found["inputs"]] == ["u"]
    described = [(each["name"], each["start"], each["unit"]) for each in found["parameters"]]
    assert described == [("m", 0.5, "kg"), ("c", 4.0, "N.s/m"), ("k", 200.0, "N/m")]
    assert [each["name"] for each in found["initial"]] == ["x", "v"]
    with Client(str(shared.client.base_url)) as client:
        assert [each.id for each in client.fmus().items] == [fmu]
        assert client.describe_fmu(fmu).sha256 == found["sha256"]
    assert fmu not in shared.client.get("/v1/datasets").text


def test_an_fmu_may_be_as_large_as_a_data_set(shared, content):
    """Other bodies have at most one megabyte."""
    large = io.BytesIO(content)
    with zipfile.ZipFile(large, "a") as archive:
        archive.writestr("resources/noise", np.random.default_rng(1).bytes(3_400_000))
    answer = send(shared, large.getvalue())
    assert answer.status_code == 201, answer.text
    assert answer.json()["bytes"] > 3_400_000
    shared.client.delete(answer.headers["location"])


def test_a_file_that_is_no_fmu_is_refused_with_the_reason(shared, content):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("a.txt", "1")
    for data in (b"no archive", stream.getvalue()):
        detail = problem_of(send(shared, data), 422, "invalid-model")
        assert detail.startswith("mass.fmu cannot be read as an FMU")
        assert "/tmp" not in detail
    assert "FILE.fmu" in problem_of(send(shared, content, "mass.zip"), 422, "invalid-model")


def test_a_service_runs_no_fmus_unless_its_operator_allows_them(serve, content):
    with serve(allow_fmus=False) as service:
        assert "ISLANDS_ALLOW_FMUS=true" in problem_of(send(service, content), 422, "invalid-settings")
        dataset = service.upload(make_axis(), "axis.npz").json()["id"]
        for path in ("/v1/discrepancies", "/v1/simulations/preview"):
            answer = service.client.post(path, json=of_fmu(dataset, ABSENT))
            assert "ISLANDS_ALLOW_FMUS=true" in problem_of(answer, 422, "invalid-settings")


def test_the_variables_of_an_fmu_are_checked_before_a_job_is_accepted(shared, dataset, fmu):
    def submit(which, **changes):
        return shared.client.post("/v1/discrepancies", json=of_fmu(dataset, which, **changes))

    detail = problem_of(submit(fmu, parameters={"mm": 1.0}), 422, "invalid-settings")
    assert detail.startswith("mass.fmu has no parameter 'mm'")
    problem_of(submit(ABSENT), 404, "no-such-fmu")
    problem_of(submit("../../etc/passwd"), 422, "invalid-request")


def test_a_preview_calibrates_the_parameters_of_the_fmu(shared, dataset, fmu):
    order = of_fmu(dataset, fmu, parameters={"m": 0.5})
    answer = shared.client.post("/v1/simulations/preview", json=order, timeout=180.0)
    assert answer.status_code == 200, answer.text
    values = {each["name"]: each["value"] for each in answer.json()["parameters"]}
    assert 0.5 < values["m"] < 0.6


def test_an_fmu_is_kept_until_the_jobs_that_name_it_have_ended(shared, dataset, content, fmu):
    job = shared.client.post("/v1/discrepancies", json=of_fmu(dataset, fmu)).json()
    assert job["spec"]["simulation"]["file"] == fmu
    problem_of(shared.client.delete(f"/v1/fmus/{fmu}"), 409, "dataset-in-use")
    shared.client.post(f"/v1/jobs/{job['id']}/cancel")
    with Client(str(shared.client.base_url)) as client:
        client.delete_fmu(fmu)
    problem_of(shared.client.get(f"/v1/fmus/{fmu}"), 404, "no-such-fmu")
    recorded = [(str(each.action), each.subject) for each in shared.store.audit.entries()]
    assert {("upload-dataset", fmu), ("delete-dataset", fmu)} <= set(recorded)
    problem_of(shared.client.post(f"/v1/jobs/{job['id']}/resume"), 409, "dataset-deleted")
    assert send(shared, content).status_code == 201


@pytest.fixture(scope="module")
def diagnosed(shared, content):
    """Id of the finished diagnosis of a record with an offset."""
    dataset = shared.upload(make_axis(0.02), "axis.npz").json()["id"]
    asked = of_fmu(dataset, send(shared, content).json()["id"])
    tolerance = {"m": 0.2, "c": 0.05, "k": 0.05}
    job = shared.client.post("/v1/discrepancies", json={**asked, "tolerance": tolerance}).json()["id"]
    assert execute_diagnosis(shared) == job
    return job


@pytest.mark.nightly
def test_a_diagnosis_of_an_fmu_names_the_missing_offset(shared, diagnosed):
    job = shared.client.get(f"/v1/jobs/{diagnosed}").json()
    assert (job["state"], job["summary"]["effects"]) == ("succeeded", ["offset"])
    report = shared.client.get(f"/v1/jobs/{diagnosed}/report")
    assert report.status_code == 200
    assert report.text.count("data:image/svg+xml") >= 3
    assert "mass.fmu" in report.text
    assert "/tmp" not in report.text
    outputs = shared.client.get(f"/v1/jobs/{diagnosed}/outputs").json()
    assert [each["name"] for each in outputs["outputs"]] == ["measured", "simulated", "extended"]
