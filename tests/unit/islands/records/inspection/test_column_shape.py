import numpy as np
import pytest

from islands.records.inspection.column_shape import (
    is_derived,
    is_feedback,
    is_label,
    measure_command,
    measure_noise_level,
)
from support.known_records import lag, steps, white


def test_commands_are_held_or_have_few_levels():
    binary = np.random.default_rng(0).integers(0, 2, 1000) * 12.0
    assert measure_command(binary) == 1.0
    assert measure_command(steps(1000, 0)) > 0.8
    assert measure_command(white(1000, 0)) == 0.0
    assert measure_command(np.full(100, 3.0)) == 0.0


def test_the_noise_level_is_that_of_added_noise():
    smooth = np.sin(np.arange(4000) / 50)
    noisy = smooth + 0.01 * smooth.std() * white(4000, 0)
    assert measure_noise_level(noisy) == pytest.approx(-2.0, abs=0.1)
    assert measure_noise_level(smooth) < -3.9


@pytest.mark.parametrize("differentiate", [np.gradient, lambda y: np.diff(y, prepend=y[0])])
def test_a_derivative_is_recognised(differentiate):
    y = lag(steps(1000, 0), 20.0) + 0.01 * white(1000, 1)
    assert is_derived(differentiate(y), y)
    assert not is_derived(steps(1000, 0), y)
    assert not is_derived(2.0 * y + 1.0, y)


def test_a_controller_with_rounded_columns_is_a_feedback_and_a_response_is_none():
    set_point = steps(800, 0, 40)
    measured = np.round(lag(set_point, 20.0) + 0.01 * white(800, 1), 2)
    assert is_feedback(np.round(20.0 * (set_point - measured)), set_point, measured)
    assert not is_feedback(2.0 * lag(set_point, 9.0), set_point, measured)
    assert not is_feedback(white(800, 3), set_point, measured)


def test_a_switched_command_is_no_label_of_its_response():
    command = (steps(2000, 0) > 0.0).astype(float)
    assert not is_label(command, command * 12.0 + 1e-3 * white(2000, 1))
    assert not is_label(command, lag(command, 10.0))
    slow = lag(white(2000, 2), 50.0)
    assert not is_label((slow < 0.0).astype(float), slow)
