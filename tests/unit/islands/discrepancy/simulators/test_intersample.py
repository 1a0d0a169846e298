"""A core in finer steps: what its input does between samples; finer steps come to the exact motion."""

from itertools import pairwise

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.discrepancy.calibration.preparation import count_fitted_samples, make_context
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.discrepancy.simulators.intersample import InterSample, ResampledSimulator, resample_context
from islands.discrepancy.simulators.second_order import SecondOrderSimulator
from islands.systems.second_order import SecondOrder
from support.simulated_records import recorded, simulate_oscillator, wave

Array = NDArray[np.float64]

#: Mass, damping, stiffness: a tenth of a second's period, ten samples.
VALUES = (0.5, 1.5, 2000.0)

signals = st.lists(st.floats(-10, 10), min_size=4, max_size=80).map(np.array)


def oscillator() -> SecondOrderSimulator:
    return SecondOrderSimulator(SecondOrder(*VALUES), ("N", "m"), 0.1)


def run(core: Simulator, u: Array) -> Array:
    record = recorded(u, u)
    simulation = ExtendedSimulator(core, (), make_context(record, core, count_fitted_samples(record)))
    return simulation.simulate(simulation.nominal)


def stepwise(u: Array) -> Array:
    """Return the exact motion under an input that stays from sample to sample."""
    numerator, denominator, _ = scipy.signal.cont2discrete(([1.0], list(VALUES)), 0.01, method="zoh")
    return scipy.signal.lfilter(np.ravel(numerator), np.ravel(denominator), u)


@pytest.mark.parametrize(
    ("hold", "exact"),
    [(InterSample.FOH, simulate_oscillator), (InterSample.ZOH, lambda u, *_: stepwise(u))],
    ids=["first-order", "zero-order"],
)
def test_finer_steps_come_to_the_exact_motion(hold: InterSample, exact) -> None:
    u = wave()
    known = exact(u, *VALUES)
    errors = [
        float(np.max(np.abs(run(ResampledSimulator(oscillator(), hold, times), u) - known)))
        / np.max(np.abs(known))
        for times in (1, 2, 4, 8)
    ]
    # Of fourth order: half the step has a sixteenth of the error.
    assert errors[-1] < 1e-4
    for coarse, fine in pairwise(errors[1:]):
        assert coarse / fine == pytest.approx(16.0, rel=0.3)


def test_one_step_a_sample_and_straight_is_the_core_itself() -> None:
    u = wave()
    assert np.array_equal(run(ResampledSimulator(oscillator()), u), run(oscillator(), u))


def test_what_it_is_apart_from_its_steps_is_the_core() -> None:
    core, between = oscillator(), ResampledSimulator(oscillator(), InterSample.ZOH, 4)
    for name in (
        "name",
        "parameters",
        "sites",
        "supported_effects",
        "built_in_effects",
        "is_continuous_time",
    ):
        assert getattr(between, name) == getattr(core, name)
    assert [each.name for each in between.state_effects] == [each.name for each in core.state_effects]


def test_its_memory_changes_nothing() -> None:
    inputs = [wave(), wave() ** 2 / 20, np.flip(wave()).copy()]
    between = ResampledSimulator(oscillator(), InterSample.BAND_LIMITED, 4)
    for u in (*inputs, *inputs):
        assert np.array_equal(
            run(between, u), run(ResampledSimulator(oscillator(), InterSample.BAND_LIMITED, 4), u)
        )


@given(signals, st.sampled_from([1, 2, 3, 8]))
def test_every_hold_passes_through_all_samples(x: Array, times: int) -> None:
    for hold in InterSample:
        u, midway = resample_context(x, hold, times)
        assert u.shape == (times * x.size,)
        assert midway.shape == (2, times * x.size)
        assert u[::times] == pytest.approx(x, abs=1e-4 * np.max(np.abs(x)) + 1e-12)
        assert np.isfinite(midway).all()


@given(signals, st.sampled_from([1, 2, 3, 8]))
def test_a_zero_order_hold_stays_and_a_first_order_one_runs_straight(x: Array, times: int) -> None:
    u, midway = resample_context(x, InterSample.ZOH, times)
    assert np.array_equal(u, np.repeat(x, times))
    # It jumps behind the end of a step, never within one.
    assert np.array_equal(midway, np.stack([u, u]))
    u, midway = resample_context(x, InterSample.FOH, times)
    assert midway[1, :-1] == pytest.approx(u[1:], abs=1e-12)
    assert midway[0, :-times] == pytest.approx((u + midway[1])[:-times] / 2, abs=1e-12)


@pytest.mark.parametrize("times", [1, 2, 4])
def test_a_band_limited_input_is_led_through_its_samples_as_it_was(times: int) -> None:
    def signal(t: Array) -> Array:
        return np.sin(0.7 * t) + 0.5 * np.cos(1.9 * t + 1) + 0.3 * np.sin(2.4 * t + 2)

    at = np.arange(600 * times) / times
    u, midway = resample_context(signal(np.arange(600.0)), InterSample.BAND_LIMITED, times)
    within = slice(70 * times, -70 * times)  # at its ends nobody knows how it goes on
    assert u[within] == pytest.approx(signal(at)[within], abs=0.02)
    assert midway[0][within] == pytest.approx(signal(at + 0.5 / times)[within], abs=0.02)
    assert midway[1][within] == pytest.approx(signal(at + 1 / times)[within], abs=0.02)
    straight = resample_context(signal(np.arange(600.0)), InterSample.FOH, 2)[0]
    assert np.max(np.abs(straight - signal(np.arange(1200) / 2))) > 0.3
