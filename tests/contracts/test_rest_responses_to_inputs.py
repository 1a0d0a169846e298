"""Responses of models to inputs of choice over REST: the numbers of the library, bounds, and problems."""

import numpy as np
import pytest

import islands
from islands.persistence.models import model_from_json
from islands.systems import signals
from islands_api.client import Client
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.store.blobs import Blobs
from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.job_runs import make_run
from support.service import problem_of, run_identification
from support.stores import taken

pytestmark = pytest.mark.ci

DT = 0.01

#: Excitations, and the inputs that they are.
EXCITATIONS = {
    "hold": ({"kind": "hold", "value": 0.7}, np.full(500, 0.7)),
    "sine": (
        {"kind": "sine", "amplitude": 2.0, "offset": 0.5, "frequency": 1.5},
        0.5 + signals.sine(DT, 5.0, 2.0, 1.5),
    ),
    "triangle": (
        {"kind": "triangle", "amplitude": 2.0, "frequency": 1.0},
        signals.triangle(DT, 5.0, 2.0, 1.0),
    ),
    "steps": ({"kind": "steps", "amplitude": -1.0, "frequency": 1.0}, signals.steps(DT, 5.0, -1.0, 1.0)),
    "sweep": (
        {"kind": "sweep", "amplitude": 1.0, "first": 0.1, "last": 40.0},
        signals.sweep(DT, 5.0, 1.0, 0.1, 40.0),
    ),
    "numbers": (np.cos(np.arange(500.0)).tolist(), np.cos(np.arange(500.0))),
}


@pytest.fixture(scope="module")
def service(serve):
    with serve() as running:
        yield running


@pytest.fixture(scope="module")
def job(service):
    return run_identification(service)


@pytest.fixture(scope="module")
def model(service, job):
    with Client(service.url) as client:
        return model_from_json(client.export(job, 1, "json"))


def ask(service, job, body, rank=1):
    return service.client.post(f"/v1/jobs/{job}/models/{rank}/simulate", json=body)


def simulate(model, u, rest):
    """Simulate a model by the library: it rests before the first sample."""
    before = model.maximum_lag
    y = np.full(before + len(u), np.nan)
    y[:before] = rest
    record = islands.Dataset(np.concatenate([np.full(before, u[0]), u]), y, DT, ("u_V",), "y_um")
    return islands.simulate(model, record).y[before:]


@pytest.mark.parametrize("kind", EXCITATIONS)
def test_the_response_is_that_of_the_library_bit_for_bit(service, job, model, kind):
    given, u = EXCITATIONS[kind]
    found = ask(service, job, {"inputs": {"u_V": given}, "samples": 500}).json()
    assert found["inputs"]["u_V"] == u.tolist()
    assert found["dt"] == DT
    assert found["time_s"] == (DT * np.arange(500)).tolist()
    assert found["initial_output"] == islands.FittedModel.from_model(model).static_characteristic(u[0])[0]
    assert found["output"] == simulate(model, u, found["initial_output"]).tolist()
    assert found["outcome"] == "ok"
    again = ask(service, job, {"inputs": {"u_V": given}, "samples": 500})
    assert again.json() == found


@pytest.mark.parametrize(
    ("body", "status", "kind", "detail"),
    [
        ({"samples": 50_001}, 422, "invalid-request", "less than or equal to 50000"),
        ({"samples": 0}, 422, "invalid-request", "greater than or equal to 1"),
        ({"inputs": {"u_V": [0.0] * 50_001}}, 413, "too-large", "50000 is the most"),
        ({"inputs": {"u_V": []}}, 422, "invalid-request", "at least 1 item"),
        ({"inputs": {"u_V": ["x"] * 9000}}, 422, "invalid-request", "valid number"),
        ({"inputs": {"u_V": {"kind": "sin"}}}, 422, "invalid-request", "Did you mean 'sine'?"),
        ({"inputs": {"u_v": [1.0]}}, 422, "invalid-settings", "Did you mean 'u_V'?"),
        ({"inputs": {"u_V": [1.0, 2.0]}, "samples": 3}, 422, "invalid-settings", "leave out samples"),
        (
            {"inputs": {"u_V": {"kind": "sine", "amplitude": 1, "frequency": 51}}},
            422,
            "invalid-settings",
            "at most 50 Hz",
        ),
        (
            {"inputs": {"u_V": {"kind": "record", "scale": 1e308, "offset": 1e308}}},
            422,
            "invalid-settings",
            "u_V overflows",
        ),
    ],
)
def test_requests_are_bounded(service, job, body, status, kind, detail):
    assert detail in problem_of(ask(service, job, body), status, kind)


def test_a_model_of_several_outputs_is_refused_with_advice(service, tmp_path):
    record = make_coupled_record(TWO_MASSES, samples=200, noise=0.01)
    table = [0.1 * np.arange(200).round(3), record.records[0].u[:, 0], *record.y.T]
    path = tmp_path / "masses.csv"
    np.savetxt(path, np.transpose(table), delimiter=",", header="t_s,u,y1,y2", comments="", fmt="%.17g")
    settings = {"population": 8, "generations": 2, "max_terms": 4, "library_degree": 1, "islands": 1}
    with Client(service.url) as client:
        job = client.submit(client.upload(path), "u", ["y1", "y2"], average=1, **settings)
        lease = taken(service.store, job.id)
        outcome = run_identification_job(make_run(lease, service.store, Blobs(service.settings.blobs)))
        service.store.leases.finish(lease, outcome)
    detail = problem_of(ask(service, job.id, {}), 404, "not-found")
    assert "has the outputs y1, y2" in detail
    assert "islands simulate" in detail
