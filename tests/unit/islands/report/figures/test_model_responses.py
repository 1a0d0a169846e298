"""Figures of the static characteristic and of the step response."""

import numpy as np
import pytest

import islands
from islands.report.figures.model_responses import draw_responses
from islands.report.figures.names import RESPONSES

RNG = np.random.default_rng(0)
LAG = islands.make_model(
    [(islands.parse("y(k-1)"), 0.5), (islands.parse("u2(k-1)"), 2.0), (islands.parse("u1(k-1)"), 1.0)],
    ("offset", "valve"),
)


@pytest.fixture(scope="module")
def record():
    u = np.column_stack([np.full(100, 3.0), RNG.uniform(0.0, 1.0, 100)])
    return islands.Dataset(u, RNG.normal(size=100), 1.0, ("offset", "valve"), "y")


def test_the_first_varying_input_steps_and_the_others_rest(record):
    drawn = draw_responses(LAG, record)
    assert tuple(drawn) == RESPONSES
    (line,) = drawn["characteristic"].axes[0].get_lines()
    assert line.get_ydata() == pytest.approx(6.0 + 4.0 * line.get_xdata())
    quartiles = np.quantile(record.u[:, 1], [0.25, 0.75])
    output = drawn["step-response"].axes[1].get_lines()[0].get_ydata()
    assert output[0] == pytest.approx(6.0 + 4.0 * quartiles[0])
    assert output[-1] == pytest.approx(6.0 + 4.0 * quartiles[1], rel=0.01)


def test_a_record_with_constant_inputs_has_no_response_figure():
    assert draw_responses(LAG, islands.Dataset(np.ones((100, 2)), RNG.normal(size=100), 1.0)) == {}


def test_a_static_model_has_no_response(record):
    gains = islands.make_model([(islands.parse("u2(k-1)"), 2.0)], ("offset+1", "valve+1"))
    assert draw_responses(gains, record) == {}
