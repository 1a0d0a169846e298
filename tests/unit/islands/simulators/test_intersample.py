"""Simulation with several steps per sample: convergence, and the input between samples."""

from itertools import pairwise

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from islands.diagnosis.calibration.preparation import count_fitted_samples
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator
from islands.simulators.intersample import InterSample, ResampledSimulator, resample_input
from islands.simulators.ode.simulator import OdeSimulator
from support.built_in_simulators import make_oscillator
from support.simulated_records import recorded, simulate_oscillator, wave

Array = NDArray[np.float64]

#: Mass, damping and stiffness; the period of the oscillation is 0.1 s, ten samples.
VALUES = (0.5, 1.5, 2000.0)


def oscillator() -> OdeSimulator:
    return make_oscillator(*VALUES)


def simulate(simulator: Simulator, u: Array) -> Array:
    record = recorded(u, u)
    context = make_context(record, simulator, count_fitted_samples(record))
    simulation = ExtendedSimulator(simulator, (), context)
    return simulation.simulate(simulation.nominal)


def simulate_held_input(u: Array) -> Array:
    """Return the exact motion for an input that is constant between samples."""
    numerator, denominator, _ = scipy.signal.cont2discrete(([1.0], list(VALUES)), 0.01, method="zoh")
    return scipy.signal.lfilter(np.ravel(numerator), np.ravel(denominator), u)


@pytest.mark.parametrize(
    ("intersample", "exact"),
    [(InterSample.FOH, simulate_oscillator), (InterSample.ZOH, lambda u, *_: simulate_held_input(u))],
    ids=["first-order", "zero-order"],
)
def test_smaller_steps_converge_to_the_exact_motion(intersample: InterSample, exact) -> None:
    u = wave()
    known = exact(u, *VALUES)
    errors = [
        float(np.max(np.abs(simulate(ResampledSimulator(oscillator(), intersample, steps), u) - known)))
        / np.max(np.abs(known))
        for steps in (1, 2, 4, 8)
    ]
    # Fourth order: half the step has a sixteenth of the error.
    assert errors[-1] < 1e-4
    for coarse, fine in pairwise(errors[1:]):
        assert coarse / fine == pytest.approx(16.0, rel=0.3)


@pytest.mark.parametrize("oversampling", [1, 2, 4])
def test_a_band_limited_input_is_reconstructed_between_its_samples(oversampling: int) -> None:
    def signal(t: Array) -> Array:
        return np.sin(0.7 * t) + 0.5 * np.cos(1.9 * t + 1) + 0.3 * np.sin(2.4 * t + 2)

    at = np.arange(600 * oversampling) / oversampling
    u, between = resample_input(signal(np.arange(600.0)), InterSample.BAND_LIMITED, oversampling)
    # Without the ends: the signal beyond them is unknown.
    within = slice(70 * oversampling, -70 * oversampling)
    assert u[within] == pytest.approx(signal(at)[within], abs=0.02)
    assert between[0][within] == pytest.approx(signal(at + 0.5 / oversampling)[within], abs=0.02)
    assert between[1][within] == pytest.approx(signal(at + 1 / oversampling)[within], abs=0.02)
    linear = resample_input(signal(np.arange(600.0)), InterSample.FOH, 2)[0]
    assert np.max(np.abs(linear - signal(np.arange(1200) / 2))) > 0.3
