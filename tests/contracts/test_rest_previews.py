"""Calibrated previews of simulations over REST."""

import numpy as np
import pytest

from islands_api import Client
from support.service import csv, held, problem_of

pytestmark = pytest.mark.ci

ODE = {
    "kind": "ode",
    "name": "lag",
    "input": "u",
    "equations": "dx/dt = (a*u - x)/tau",
    "output": "x",
    "parameters": {"tau": {"value": 0.02, "unit": "s"}, "a": {"value": 1.0}},
}

MODEL = {
    "schema": "islands.model/1",
    "inputs": ["u_V"],
    "output": "y_um",
    "dt": 0.01,
    "terms": [{"regressor": "y(k-1)", "parameter": 0.5}, {"regressor": "u(k-1)", "parameter": 0.3}],
}


@pytest.fixture(scope="module")
def shared(serve):
    with serve() as running:
        yield running


@pytest.fixture(scope="module")
def dataset(shared):
    return shared.upload(csv(400)).json()["id"]


def preview(service, dataset, simulation, **changes):
    order = held(dataset, simulation=simulation, **changes)
    return service.client.post("/v1/simulations/preview", json=order, timeout=120.0)


@pytest.mark.parametrize(
    ("simulation", "most"),
    [
        ({"kind": "linear", "order": 1, "delay": 1}, 0.01),
        ({"kind": "model", "model": MODEL}, 20.0),
        (ODE, 20.0),
        ({"kind": "second-order"}, 100.0),
    ],
)
def test_a_preview_has_the_calibrated_output_and_its_error(shared, dataset, simulation, most):
    answer = preview(shared, dataset, simulation)
    assert answer.status_code == 200, answer.text
    document = answer.json()
    measured, simulated = (np.array(each["minimum"]) for each in document["columns"])
    assert [each["name"] for each in document["columns"]] == ["measured", "simulated"]
    error = 100.0 * np.mean(np.abs(simulated - measured)) / np.ptp(measured)
    assert document["error_percent"] == pytest.approx(error)
    assert error <= most
    assert (document["start"], document["stop"], document["samples"]) == (0, 400, 400)
    assert document["estimation_samples"] == 300


def test_the_rows_and_the_points_of_a_preview_are_those_of_the_request(shared, dataset):
    with Client(str(shared.client.base_url)) as client:
        found = client.preview(dataset, "u_V", "y_um", "linear:1", rows="50:350", points=100)
    assert (found.start, found.stop, len(found.rows)) == (0, 300, 100)
    assert [each.name for each in found.parameters[:2]] == ["b0", "b1"]


def test_a_simulation_that_diverges_or_lacks_a_name_is_a_problem(shared, dataset):
    fast = {**ODE, "equations": "dx/dt = 1e6*(x*x + u*u) + a + tau"}
    assert "diverges" in problem_of(preview(shared, dataset, fast), 422, "invalid-record")
    wrong = preview(shared, dataset, ODE, tolerance={"tua": 0.1})
    assert "Did you mean 'tau'" in problem_of(wrong, 422, "invalid-settings")
    absent = preview(shared, dataset, ODE, output="z_um")
    assert "has no column z_um" in problem_of(absent, 422, "invalid-record")
    problem_of(preview(shared, "0-csv", ODE), 404, "no-such-dataset")
