"""Every path from a measured record to an output of a model gives the same output."""

from dataclasses import replace

import numpy as np
import pytest

from islands.export import export
from islands.expressions.parsing import parse
from islands.facade.results.model_simulation import predict, simulate
from islands.models.narx import make_model, measured_model
from islands.models.operating_point import static_characteristic
from islands.models.signal_statement import describe_values
from islands.persistence.models import model_from_json, model_json
from islands.records.averaging import average_samples
from islands.records.dataset import Dataset
from islands.records.input_lead import advance_inputs
from islands.records.preprocessing import preprocess
from islands.records.signal_map import match_rate
from islands.simulation.input_response import step_response
from islands.simulation.predictors import free_run

STEPS = (
    {"detrend": "constant"},
    {"detrend": "linear"},
    {"lowpass": 5.0},
    {"decimate": 4},
    {"lowpass": 5.0, "decimate": 3, "detrend": "constant"},
)


def measured(samples=400):
    rng = np.random.default_rng(3)
    u = 4.0 + np.repeat(rng.uniform(-1.0, 1.0, (samples // 10, 2)), 10, axis=0)
    y = 7.0 + 0.1 * np.cumsum(u[:, 0] - 4.0)
    return Dataset(u, y, 0.01, ("a_V", "b_V"), "y_um")


def fitted(steps, feedthrough=False, average=1):
    """Return the record of a search, and a model of it."""
    # The line of a linear trend belongs to the record of the search: another record keeps its drift.
    searched = preprocess(measured(), **steps)
    prepared = average_samples(preprocess(measured(), like=searched), average)
    if feedthrough:
        prepared = advance_inputs(prepared, (0,))
    terms = [("y(k-1)", 0.8), ("u1(k-1)", 0.2), ("y(k-2)*u2(k-1)", 0.01), ("sign(u1(k-2))", 0.05)]
    model = make_model(
        [(parse(text), value) for text, value in terms], prepared.input_names, "y_um", prepared.dt
    )
    return prepared, replace(model, average=average, preprocessing=prepared.preprocessing)


def expected_output(prepared, model):
    """Return the simulation in the signals of the search, with the offset of the output."""
    return free_run(replace(model, preprocessing=None), prepared).y + model.preprocessing.output_offset


def run_python(model, record):
    program = {}
    exec(export(model, "python"), program)
    data = match_rate(model, record)
    inputs = data.u.T.copy()
    simulated = np.array(program["simulate"](*inputs, data.y))
    simulated[: model.maximum_lag] = np.nan
    return simulated


PATHS = {
    "simulate": lambda model, record: simulate(model, record).y,
    "free run": lambda model, record: free_run(model, record).y,
    "at the rate of the model": lambda model, record: free_run(model, match_rate(model, record)).y,
    "model file": lambda model, record: simulate(model_from_json(model_json(model)), record).y,
    "measured units": lambda model, record: free_run(measured_model(model), record).y,
    "inputs in another order": lambda model, record: (
        simulate(model, replace(record, u=record.u[:, ::-1], input_names=record.input_names[::-1])).y
    ),
    "python": run_python,
}


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("average", [1, 2])
@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("steps", STEPS, ids=str)
def test_every_path_gives_the_output_of_the_search(steps, feedthrough, average, path):
    prepared, model = fitted(steps, feedthrough, average)
    found = PATHS[path](model, measured())
    # The value of an advanced input behind the end of a record is unknown and unused by the search.
    np.testing.assert_allclose(found[:-1], expected_output(prepared, model)[:-1], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("steps", STEPS, ids=str)
def test_a_prediction_has_a_value_for_every_sample(steps):
    prepared, model = fitted(steps)
    predicted = predict(model, measured())
    assert predicted.shape == (400,)
    every = steps.get("decimate", 1)
    np.testing.assert_allclose(predicted[::every], expected_output(prepared, model), rtol=1e-9)
    assert np.isfinite(predicted[2 * every :]).all()


def test_offsets_belong_to_equilibria_and_step_responses():
    _, model = fitted({"detrend": "constant"})
    linear = replace(
        make_model([(parse("y(k-1)"), 0.5), (parse("u1(k-1)"), 1.0)], model.input_names, "y_um", 0.01),
        preprocessing=model.preprocessing,
    )
    offsets = model.preprocessing.input_offsets
    rest = static_characteristic(linear, [offsets, (offsets[0] + 1.0, offsets[1])])
    np.testing.assert_allclose(rest - model.preprocessing.output_offset, [0.0, 2.0], atol=1e-9)
    response = step_response(linear, offsets, (offsets[0] + 1.0, offsets[1]))
    assert response.y[0] == pytest.approx(rest[0])
    assert response.y[-1] == pytest.approx(rest[1], rel=1e-2)


def test_programs_state_the_filter_and_the_decimation():
    _, model = fitted({"lowpass": 5.0, "decimate": 3})
    for kind in ("python", "c", "matlab"):
        assert f"{describe_values(model)}." in export(model, kind)
