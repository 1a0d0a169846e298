"""Limits of a sensor: flat extremes of a signal."""

import numpy as np
import pytest

from islands.records.flat_extremes import SensorLimits, find_limits


def wave(samples=2000):
    return np.sin(0.02 * np.arange(samples)) + 0.3 * np.sin(0.0331 * np.arange(samples))


@pytest.mark.parametrize(("lower", "upper"), [(None, 0.7), (-0.5, None), (-0.6, 0.8), (None, None)])
def test_the_limits_of_a_clipped_signal_are_found(lower, upper):
    assert find_limits(np.clip(wave(), lower, upper)) == SensorLimits(lower, upper)


def test_the_rest_before_a_recording_moves_is_no_limit():
    move = 1.0 + wave()[:400] + 0.3 * np.sin(0.5 * np.arange(400))
    rest = np.zeros(50)
    two = np.concatenate([rest, move + 1.0, rest, move + 1.0])
    assert find_limits(two[:450]) == SensorLimits()
    assert find_limits(two, ((0, 450), (450, 900))) == SensorLimits()
    # Without a new recording, the signal returns to its extreme.
    assert find_limits(two) == SensorLimits(0.0)
    constants = np.repeat([0.0, 1.0, 2.0], 4)
    assert find_limits(constants, ((0, 4), (4, 8), (8, 12))) == SensorLimits()
    # A sensor that is at its limit at the start, and later again.
    assert find_limits(np.clip(-wave(), None, -0.1)) == SensorLimits(None, -0.1)


def test_signals_that_are_held_or_have_two_levels_have_no_limits():
    held = np.repeat(np.random.default_rng(0).uniform(-1.0, 1.0, 40), 25)
    assert find_limits(held) == SensorLimits()
    assert find_limits(np.sign(wave())) == SensorLimits()


@pytest.mark.parametrize(
    "limits", [SensorLimits(), SensorLimits(-1.0), SensorLimits(None, 2.5), SensorLimits(-1.0, 2.5)]
)
def test_the_expression_of_limits_is_their_range(limits):
    names = {"min": min, "max": max, "y": 0.0}
    for value in (-4.0, 0.5, 4.0):
        lower, upper = limits.range
        assert eval(limits.write("y"), {**names, "y": value}) == min(max(value, lower), upper)
