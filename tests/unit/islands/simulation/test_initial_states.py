"""Initial states of a free run: those of the least error over the warm-up."""

from dataclasses import replace

import numpy as np
import pytest

from islands.export import export
from islands.kernels.state_space import simulate_state_space
from islands.simulation.initial_states import (
    Segment,
    estimate_initial_states,
    estimate_states,
    simulate_errors,
)
from islands.simulation.outcome import Status
from islands.simulation.predictors import free_run
from support.latent_systems import SPRING, make_model, spring_record


def make_segment(u, y):
    """Return a segment of the types that a record gives: kernels are compiled for each type."""
    measured = np.array(y)
    measured.flags.writeable = False
    return Segment(np.array(u), measured)


def test_states_of_a_record_without_noise_are_found():
    record = spring_record(400, start=(0.5, -0.4))
    model = make_model()
    found = estimate_states(model.theta, model.codes, make_segment(record.u, record.y), model.rest)
    assert found == pytest.approx([0.5, -0.4], abs=1e-3)


def test_outputs_after_the_warm_up_have_no_influence():
    record, model = spring_record(200), make_model()
    found = estimate_initial_states(model, record, np.array([50]), 50)
    changed = spring_record(200)
    changed.y.flags.writeable = True
    changed.y[50:] = 7.0
    changed.y.flags.writeable = False
    assert (estimate_initial_states(model, changed, np.array([50]), 50) == found).all()


def test_a_model_that_diverges_in_the_warm_up_diverges_at_the_first_prediction():
    model = make_model(SPRING | {"a1_1": 3.0, "a2_2": 3.0})
    run = free_run(model, spring_record(200), 100)
    assert run.outcome.verdict is Status.DIVERGED
    assert "at sample 100" in run.outcome.reason


def test_states_are_estimated_although_the_model_diverges_from_rest():
    """The cubic spring softens: from rest, an input that is too large takes it beyond its maximum."""
    softening = SPRING | {"e2_1": 0.02}
    record = spring_record(60)
    theta, codes = make_model(softening).theta, make_model(softening).codes
    states, y = np.array([0.5, -0.4]), np.empty(60)
    u = np.ascontiguousarray(record.u)
    assert simulate_state_space(theta, codes, u, states.copy(), y) == 60
    far = np.array([4.0, 4.0])
    assert simulate_errors(theta, codes, make_segment(u, y), far) is None
    assert estimate_states(theta, codes, make_segment(u, y), far) == pytest.approx(states, abs=2e-3)


@pytest.mark.parametrize("unit", ["tanh", "saturation", "root"])
def test_estimated_states_never_have_a_larger_error_than_the_states_at_rest(unit):
    """Without a limit, the steps of these systems increase the error."""
    model = make_model({**SPRING, "e2_1": -2.0}, (unit,))
    for seed in range(6):
        rng = np.random.default_rng(seed)
        segment, rest = (
            make_segment(rng.standard_normal((60, 1)), rng.standard_normal(60)),
            rng.standard_normal(2),
        )
        found = estimate_states(model.theta, model.codes, segment, 2.0 * rest)
        errors = [
            float(np.sum(simulate_errors(model.theta, model.codes, segment, states) ** 2))
            for states in (found, 2.0 * rest)
        ]
        assert errors[0] < errors[1]


def test_a_minimum_away_from_rest_is_found():
    # The output does not show the sign of the state, and at rest its slope is zero.
    model = make_model({"a1_1": 0.9, "b1": 0.1, "f1": 2.0, "w1_1": 1.0}, ("bell",), 1, input_names=("u+1",))
    states = 1.8 * 0.9 ** np.arange(60)
    record = make_segment(np.zeros((60, 1)), 2.0 * np.exp(-(states**2)))
    assert model.rest == pytest.approx([0.0])
    found = estimate_states(model.theta, model.codes, record, model.rest)
    assert np.abs(found) == pytest.approx([1.8], abs=0.01)


def test_without_measured_outputs_the_states_rest_at_the_operating_point():
    record, module = spring_record(100), {}
    model = make_model(operating_inputs=(0.5,))
    exec(export(model, "python"), module)
    run = free_run(model, replace(record, y=np.full(100, np.nan)))
    assert np.isnan(run.y[:20]).all()
    assert run.y[20:] == pytest.approx(module["simulate"](record.u[:, 0].tolist())[20:], abs=1e-12)
