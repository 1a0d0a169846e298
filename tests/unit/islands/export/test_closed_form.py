"""Closed form of an extended simulation: its free run is the simulation."""

from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.calibration.record_simulation import simulate_spec
from islands.errors import ModelError
from islands.export.closed_form import closed_form
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from support.extended_simulations import extended
from support.simulated_records import DT, MODEL, wave

CORES = {
    "model": {"kind": "model", "model": MODEL},
    "linear": {"kind": "linear", "order": 1, "numerator": [0.3, 0.1], "denominator": [0.7], "level": 2.0},
    "delayed": {
        "kind": "linear",
        "order": 2,
        "delay": 3,
        "numerator": [0.1, 0, 0.2],
        "denominator": [1.1, -0.3],
    },
    "referred": {
        "kind": "linear",
        "order": 1,
        "numerator": [0.3, 0.1],
        "denominator": [0.7],
        "level": 2.0,
        "reference_input": -0.4,
    },
    "static": {"kind": "linear", "order": 0, "numerator": [0.5], "denominator": []},
}

EFFECTS = {
    "none": {},
    "input": {"input-gain": {"k": 0.1}, "input-saturation": {"cut": 0.2}},
    "dead zone": {"dead-zone": {"d": 0.3}},
    "negative dead zone": {"dead-zone": {"d": -0.3}},
    "output": {"sensor-gain": {"k": -0.2}, "offset": {"c": 3.0}},
    "both": {"dead-zone": {"d": 0.1}, "offset": {"c": -1.0}},
}


@pytest.fixture(scope="module")
def record():
    u = 1.5 * wave()
    y = np.cumsum(u) * DT
    return Dataset(u[:, None], y, DT, input_names=("u_V",), output_name="y_um")


@pytest.mark.parametrize("effects", EFFECTS)
@pytest.mark.parametrize("core", CORES)
def test_the_free_run_is_the_simulation(core, effects, record):
    spec = extended(CORES[core], EFFECTS[effects])
    simulated = simulate_spec(spec, record)
    found = closed_form(spec)
    run = free_run(found, replace(record, y=simulated))
    assert run.outcome
    known = ~np.isnan(run.y)
    assert known.sum() > record.samples - 10
    late = record.samples - run.y.size
    np.testing.assert_allclose(run.y[known], simulated[late:][known], rtol=1e-9, atol=1e-9)
    assert (found.dt, found.column_names, found.output_name) == (DT, ("u_V",), "y_um")


@pytest.mark.parametrize(
    ("core", "effects", "further", "message"),
    [
        ({"kind": "bouc-wen-piezo"}, {}, {}, "the simulation bouc-wen-piezo has no closed form"),
        ({"kind": "linear", "order": 1}, {}, {}, "the simulation linear has no closed form"),
        (CORES["model"], {"delay": {"tau": 0.02}}, {}, "the effect delay has no closed form"),
        (CORES["model"], {}, {"times": 2}, "several steps per sample has no closed form"),
    ],
)
def test_other_simulations_are_refused_with_the_formats_that_are_possible(core, effects, further, message):
    with pytest.raises(ModelError, match="take the format plain, python") as caught:
        closed_form(extended(core, effects, **further))
    assert message in str(caught.value)
