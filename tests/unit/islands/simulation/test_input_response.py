"""Responses of models to inputs of choice."""

import numpy as np
import pytest

import islands
from islands.simulation.input_response import input_response, step_response

LAG = islands.make_model([(islands.parse("y(k-1)"), 0.9), (islands.parse("u(k-1)"), 0.2)], dt=0.5)
DIRECT = islands.make_model([(islands.parse("u(k-1)"), 3.0)], ("u_V+1",))
HYSTERESIS = islands.make_model([(islands.parse("y(k-1)"), 1.0), (islands.parse("u(k-1) - u(k-2)"), 0.8)])
UNSTABLE = islands.make_model([(islands.parse("y(k-1)"), 2.0), (islands.parse("u(k-1)"), 1.0)])
U = np.sin(np.arange(40) / 3.0) + 1.0
STEPPED_HYSTERESIS = islands.make_model(
    [(islands.parse("y(k-1)"), 1.0), (islands.parse("u(k-1) - u(k-2)"), 0.8)], output_name="y"
)


def test_the_response_is_the_free_run_of_a_record_that_rests_before_it():
    found = input_response(LAG, U)
    record = islands.Dataset(np.append(U[0], U), np.append(2.0 * U[0], np.full(40, np.nan)), 0.5)
    assert found.y[0] == pytest.approx(2.0 * U[0])
    assert found.y == pytest.approx(islands.simulate(LAG, record).y[1:], rel=1e-14)
    assert found.time[:2].tolist() == [0.0, 0.5]
    assert found.u[:, 0].tolist() == U.tolist()


def test_an_input_that_acts_at_once_acts_on_the_first_sample():
    # The last value has no successor, so the input is held.
    assert input_response(DIRECT, U, 0.0).y == pytest.approx(3.0 * U)


def test_a_model_of_hysteresis_starts_from_a_given_output():
    with pytest.raises(islands.ModelError, match="give the output y"):
        input_response(HYSTERESIS, U)
    assert input_response(HYSTERESIS, U, 5.0).y[-1] == pytest.approx(5.0 + 0.8 * (U[-2] - U[0]))


def test_a_divergence_is_stated_and_depends_on_the_size_of_the_output():
    found = input_response(UNSTABLE, U, 0.0)
    assert not found.outcome
    assert np.isnan(found.y[-1])
    assert input_response(UNSTABLE, U, 0.0, scale=1e9).outcome


@pytest.mark.parametrize(
    ("u", "y", "message"),
    [
        (np.zeros((3, 2)), 0.0, r"shape \(samples, 1\), got \(3, 2\)"),
        ([], 0.0, "at least 1 sample"),
        ([0.0, np.inf], 0.0, "NaN or infinite"),
        ([0.0], np.nan, "finite number"),
    ],
)
def test_unusable_inputs_are_refused(u, y, message):
    with pytest.raises(islands.SettingsError, match=message):
        input_response(LAG, u, y)


def test_a_first_order_response_is_exponential():
    found = step_response(LAG, 1.0, 2.0)
    after = found.time >= 0
    steps = np.arange(after.sum())
    assert found.y[~after] == pytest.approx(2.0)
    assert found.y[after] == pytest.approx(4.0 - 2.0 * 0.9**steps)
    assert found.time[after][1] == 0.5
    assert found.u[after][0] == 2.0
    # The response is simulated until it has settled.
    assert abs(found.y[-1] - 4.0) < 0.02
    assert repr(found) == f"<StepResponse of {len(found.time)} samples: u to y>"


def test_a_model_of_hysteresis_steps_from_a_given_output():
    with pytest.raises(islands.ModelError, match="give the output y"):
        step_response(STEPPED_HYSTERESIS, 0.0, 1.0)
    assert step_response(STEPPED_HYSTERESIS, 0.0, 1.0, y=5.0).y[-1] == pytest.approx(5.8)


@pytest.mark.parametrize(
    ("start", "end", "samples", "message"),
    [
        ([0.0, 1.0], 1.0, None, "one value for each"),
        (1.0, 1.0, None, "no input changes"),
        (0.0, 1.0, 0, "at least 1"),
    ],
)
def test_impossible_steps_are_refused(start, end, samples, message):
    with pytest.raises(islands.SettingsError, match=message):
        step_response(LAG, start, end, samples=samples)
