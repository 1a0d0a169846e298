"""Responses of models to inputs of choice over REST: the numbers of the library, bounds, and problems."""

import numpy as np
import pytest

import islands
from islands.persistence.models import any_model_from_json, model_from_json
from islands.systems import signals
from islands_api.client import Client
from support.service import problem_of

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
def model(identified, job):
    with Client(identified.url) as client:
        return model_from_json(client.export(job, 1, "json"))


def ask(identified, job, body, rank=1):
    return identified.client.post(f"/v1/jobs/{job}/models/{rank}/simulate", json=body)


def simulate(model, u, rest):
    """Simulate a model by the library: it rests before the first sample."""
    before = model.maximum_lag
    y = np.full(before + len(u), np.nan)
    y[:before] = rest
    record = islands.Dataset(np.concatenate([np.full(before, u[0]), u]), y, DT, ("u_V",), "y_um")
    return islands.simulate(model, record).y[before:]


@pytest.mark.parametrize("kind", EXCITATIONS)
def test_the_response_is_that_of_the_library_bit_for_bit(identified, job, model, kind):
    given, u = EXCITATIONS[kind]
    found = ask(identified, job, {"inputs": {"u_V": given}, "samples": 500}).json()
    assert found["inputs"]["u_V"] == u.tolist()
    assert found["dt"] == DT
    assert found["time_s"] == (DT * np.arange(500)).tolist()
    assert found["initial_outputs"] == {
        "y_um": islands.FittedModel.from_model(model).static_characteristic(u[0])[0]
    }
    assert found["outputs"] == {"y_um": simulate(model, u, found["initial_outputs"]["y_um"]).tolist()}
    assert found["outcome"] == "ok"
    again = ask(identified, job, {"inputs": {"u_V": given}, "samples": 500})
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
def test_requests_are_bounded(identified, job, body, status, kind, detail):
    assert detail in problem_of(ask(identified, job, body), status, kind)


def test_a_model_of_several_outputs_returns_every_output(identified, outputs):
    (stored,) = identified.store.results.models(outputs, 1)
    model = islands.FittedModel.from_model(any_model_from_json(stored.file, "model"))
    u = np.sin(0.2 * np.arange(80.0))
    found = ask(identified, outputs, {"inputs": {"u": u.tolist()}}).json()
    assert found["outputs"] == dict(zip(("y1", "y2"), model.simulate(u).y.T.tolist(), strict=True))
    assert found["start"].startswith("before the first sample y1 is ")
    assert " and y2 is " in found["start"]
    given = {"y1": 0.5, "y2": -0.25}
    found = ask(identified, outputs, {"inputs": {"u": u.tolist()}, "initial_output": given}).json()
    assert found["initial_outputs"] == given
    assert found["outputs"]["y2"] == model.simulate(u, y=[0.5, -0.25]).y[:, 1].tolist()
    recorded = ask(identified, outputs, {"inputs": {"u": {"kind": "record"}}, "samples": 50}).json()
    assert {len(each) for each in recorded["outputs"].values()} == {50}
    one = ask(identified, outputs, {"initial_output": 1.0})
    assert "initial_output of each by name" in problem_of(one, 422, "invalid-settings")
