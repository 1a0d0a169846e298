"""Step responses of models."""

import numpy as np
import pytest

import islands
from islands.simulation.step_response import step_response

LAG = islands.make_model([(islands.parse("y(k-1)"), 0.9), (islands.parse("u(k-1)"), 0.2)], dt=0.5)
HYSTERESIS = islands.make_model(
    [(islands.parse("y(k-1)"), 1.0), (islands.parse("u(k-1) - u(k-2)"), 0.8)], output_name="y"
)


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
        step_response(HYSTERESIS, 0.0, 1.0)
    assert step_response(HYSTERESIS, 0.0, 1.0, y=5.0).y[-1] == pytest.approx(5.8)


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
