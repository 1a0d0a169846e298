"""Signals at three moments of each step: delays, rates, and divided steps."""

import numpy as np
import pytest

from islands.simulators.ode.sampled_signal import SampledSignal, interpolate_linearly

DT = 0.01
SAMPLES = 200
TIME = DT * np.arange(SAMPLES)
FORCE = 3.0 * np.sin(7.0 * TIME) + 2.0 * np.cos(3.1 * TIME)


def test_a_delay_of_a_linear_signal_is_exact_between_samples() -> None:
    signal, steps = interpolate_linearly(FORCE), np.arange(SAMPLES)
    delayed = signal.delay(0.237 * DT, DT)
    for part, ahead in ((delayed.start, 0.0), (delayed.middle, 0.5), (delayed.end, 1.0)):
        assert part == pytest.approx(np.interp(steps + ahead - 0.237, steps, FORCE), abs=1e-13)


def test_the_delay_of_a_held_signal_keeps_its_mean() -> None:
    held = SampledSignal.join(FORCE, FORCE, FORCE)
    delayed = held.delay(0.3 * DT, DT)
    assert delayed.start[1:] == pytest.approx(0.7 * FORCE[1:] + 0.3 * FORCE[:-1], abs=1e-13)
    assert delayed.start[0] == FORCE[0]


@pytest.mark.parametrize("width", [0.02, 0.3, 1.7])
def test_the_rate_of_a_signal_with_kinks_has_the_length_of_its_path(width: float) -> None:
    """A hysteresis that does not depend on the rate follows the path of its input alone."""
    moments = interpolate_linearly(FORCE).moments
    for mapped in (np.round(moments / width) * width, np.clip(moments, -width, width)):
        rate = SampledSignal(mapped, has_kinks=True).differentiate(DT)
        halves = np.diff(mapped)
        weights = np.array([1.0, 4.0, 1.0]) * DT / 6.0
        assert rate.moments @ weights == pytest.approx(halves.sum(axis=1), abs=1e-12)
        assert np.abs(rate.moments) @ weights == pytest.approx(np.abs(halves).sum(axis=1), abs=1e-12)


def test_the_rate_of_a_signal_with_kinks_is_continuous_in_its_values() -> None:
    """The signal rises by one in the first half of a step, and turns in the second half, or not."""
    last = np.linspace(-1.5, 2.5, 4001)
    ones = np.ones(last.size)
    signal = SampledSignal(np.column_stack([0.0 * ones, ones, ones + last]), has_kinks=True)
    assert np.abs(np.diff(signal.differentiate(1.0).moments, axis=0)).max() <= 6.01e-3
