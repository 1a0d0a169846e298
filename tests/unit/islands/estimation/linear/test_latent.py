"""The linear model of a record as a latent model."""

import numpy as np
import pytest

from islands.errors import RecordError
from islands.estimation.linear.identify import identify_linear
from islands.estimation.linear.latent import identify_linear_model
from islands.models.latent import LatentModel
from islands.records.dataset import Dataset
from islands.records.input_lead import advance_all_inputs
from islands.simulation.initial_outputs import simulate_freely

#: Samples of a recording, gain, pole, and dead time of the law.
SAMPLES, GAIN, POLE, DELAY = 300, 2.0, 0.9, 4


def make_record(noise=0.01, direct=0.0):
    """Return two recordings of a first-order lag with a dead time, about an operating point."""
    rng, parts = np.random.default_rng(3), []
    u = 50.0 + np.repeat(rng.standard_normal(2 * SAMPLES // 10), 10)
    for recording in np.split(u, 2):
        x, y = GAIN * recording[0], np.empty(SAMPLES)
        for k in range(SAMPLES):
            y[k] = x + direct * recording[k] - 30.0
            x = POLE * x + (1.0 - POLE) * GAIN * recording[max(k - DELAY * (not direct), 0)]
        parts.append(y)
    y = np.concatenate(parts) + noise * rng.standard_normal(u.size)
    return Dataset(u, y, 0.5, ("u_V",), "T_K", segments=(SAMPLES, SAMPLES))


@pytest.fixture(scope="module")
def found():
    record = make_record()
    return record, identify_linear_model(record)


@pytest.mark.ci
def test_the_latent_model_is_the_identified_one(found):
    record, model = found
    linear = identify_linear(record.u, record.y, record.dt, record.segments)
    assert (model.order, model.delays) == (linear.order, tuple(linear.delays[0]))
    own, same = model.linearise(), linear.state_space()
    assert own.dead_times == same.dead_times
    assert own.static_gain == pytest.approx(same.static_gain, rel=1e-9)
    expected = linear.simulate(record.u[:SAMPLES])[:, 0]
    run = simulate_freely(model, record[:SAMPLES]).y
    assert run[model.memory :] == pytest.approx(expected[model.memory :], abs=0.02)


def test_quantities_have_the_errors_of_the_identification(found):
    record, model = found
    values = {each.name: each.value for each in model.quantities}
    errors = dict(zip(values, model.known_errors, strict=True))
    true = {"time constant": -record.dt / np.log(POLE), "static gain": GAIN}
    for name, value in true.items():
        assert 0.0 < errors[name] < 0.05 * value
        assert abs(values[name] - value) < 4.0 * errors[name]
    assert values["dead time"] == pytest.approx(DELAY * record.dt)
    assert not errors["dead time"] > 0.01 * record.dt  # other dead times have almost no weight
    assert "dead time of u_V 2" in model.equation().named


def test_a_document_keeps_dead_times_and_errors(found):
    _, model = found
    again = LatentModel.read(model.document(), "model.json")
    assert again.delays == model.delays
    assert again.known_errors == pytest.approx(model.known_errors, nan_ok=True)


@pytest.mark.ci
def test_an_input_that_acts_within_the_sample_is_read_early():
    record = make_record(direct=0.5)
    early = identify_linear_model(advance_all_inputs(record))
    assert early.reads_at_once
    static = Dataset(record.u, 3.0 * record.u[:, 0] + 1.0, 0.5, ("u_V",), "T_K")
    with pytest.raises(RecordError, match="one sample early"):
        identify_linear_model(static)
    assert identify_linear_model(advance_all_inputs(static)).order == 0
    run = simulate_freely(identify_linear_model(advance_all_inputs(static)), static)
    assert run.mean_squared_error < 1e-12
