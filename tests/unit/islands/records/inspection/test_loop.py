from dataclasses import replace

import numpy as np
import pytest

from islands.records.inspection.loop import check_loop
from support.known_records import delay, hysteresis, lag, measure, slow


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_loop_of_a_hysteresis_remains_at_low_frequency(noise):
    for seed in range(3):
        u = slow(3000, seed)
        fact = check_loop(measure(u, hysteresis(u), noise, seed), 0)
        assert fact.value is True
        assert fact.confidence > 0.9


def test_turning_points_of_one_repeated_loop_tell_hysteresis_from_delay():
    u = np.sin(2.0 * np.pi * np.arange(4000) / 400.0)
    assert check_loop(measure(u, hysteresis(u)), 0).value is True
    for y in (delay(u, 20), lag(u, 50.0)):
        assert check_loop(measure(u, y), 0).value is False


def test_loop_of_an_integrator_is_none_of_a_hysteresis():
    for seed in range(3):
        u = slow(3000, seed)
        y = np.cumsum(lag(u - u.mean(), 10.0))
        assert check_loop(measure(u, y, 0.02, seed), 0).value is not True


def test_two_levels_do_not_tell_a_hysteresis_from_a_time_constant():
    u = (slow(3000, 1) > 0.0).astype(np.float64)
    fact = check_loop(measure(u, lag(lag(u, 60.0), 400.0)), 0)
    assert fact.value is None
    assert fact.finding == "loop_two_levels"


def test_the_part_of_the_record_in_which_an_input_makes_no_loop_is_named():
    u = np.linspace(0.0, 1.0, 500)
    record = replace(measure(u, u**2), segments=(300, 200), recordings=("", ""))
    assert check_loop(record, 0).details["longest"] == 300
