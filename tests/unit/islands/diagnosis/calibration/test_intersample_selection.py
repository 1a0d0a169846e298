"""Intersample selection: the behaviour and the step that generated a record are found."""

from dataclasses import replace

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from islands.diagnosis.calibration.intersample_selection import (
    enlarge_step,
    get_discretisation,
    select_intersample,
)
from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    evaluate_fit,
)
from islands.diagnosis.calibration.preparation import count_fitted_samples
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.screening import screen_effects
from islands.diagnosis.run import DiagnosisRun
from islands.effects.timing import DELAY
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator
from islands.simulators.intersample import InterSample, ResampledSimulator
from islands.simulators.ode.simulator import OdeSimulator, make_ode_simulator
from islands.simulators.ode.system_document import make_system
from support.built_in_simulators import make_oscillator
from support.simulated_records import recorded

Array = NDArray[np.float64]

SAMPLES, DT, FINE = 800, 0.01, 20


def oscillator(m: float = 0.5, c: float = 2.0, k: float = 500.0) -> OdeSimulator:
    return make_oscillator(m, c, k)


def simulate_finely(u: Array, m: float = 0.5, c: float = 2.0, k: float = 500.0, linear: bool = True) -> Array:
    """Return every ``FINE``-th sample of the motion; the input is linear or constant between fine samples."""
    t = DT / FINE * np.arange(u.size)
    return np.asarray(scipy.signal.lsim(([1.0], [m, c, k]), u, t, interp=linear)[1])[::FINE]


def make_inputs(intersample: InterSample) -> tuple[Array, Array]:
    """Return a sampled input, and the same input on the fine grid."""
    t = DT / FINE * np.arange(SAMPLES * FINE)
    rng = np.random.default_rng(5)
    if intersample == InterSample.BAND_LIMITED:
        lines = rng.uniform(0.3, 38.0, 40), rng.uniform(0, 2 * np.pi, 40)
        u = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(*lines, strict=True))
        return u[::FINE], u
    u = rng.standard_normal(SAMPLES)
    if intersample == InterSample.ZOH:
        return u, np.repeat(u, FINE)
    return u, np.interp(np.arange(t.size) / FINE, np.arange(SAMPLES), u)


def calibrate_to(record: Dataset, core: Simulator) -> tuple[CalibrationResult, Target]:
    samples = count_fitted_samples(record)
    simulation = ExtendedSimulator(core, (), make_context(record, core, samples))
    target = Target(record.y, np.arange(record.samples) < samples, None, {}, fitted=samples)
    return calibrate(simulation, target, simulation.nominal), target


def add_noise(y: Array, level: float = 0.01, seed: int = 8) -> Array:
    return y + level * y.std() * np.random.default_rng(seed).standard_normal(y.size)


def get_intersample(core: Simulator) -> InterSample:
    return core.intersample if isinstance(core, ResampledSimulator) else InterSample.FOH


@pytest.mark.parametrize("intersample", InterSample)
def test_intersample_behaviour_of_the_record_is_selected(intersample: InterSample) -> None:
    u, fine_u = make_inputs(intersample)
    fit, target = calibrate_to(
        recorded(
            u, add_noise(simulate_finely(fine_u, linear=intersample != InterSample.ZOH)), DT, ("N", "m")
        ),
        oscillator(),
    )
    assert get_intersample(select_intersample(fit, target)) == intersample
    refitted = fit
    for _ in range(2):  # with the right behaviour the residual is smaller, so that steps have to be finer
        core = select_intersample(refitted, target)
        refitted = calibrate(ExtendedSimulator(core, (), fit.simulation.context), target, refitted.values)
    assert refitted.mean_square == pytest.approx((0.01 * target.y.std()) ** 2, rel=0.2)
    assert refitted.values[:3] == pytest.approx((0.5, 2.0, 500.0), rel=0.02)
    # A second selection does not change the result.
    assert get_intersample(select_intersample(refitted, target)) == intersample


def test_a_behaviour_that_matches_a_record_without_noise_is_selected() -> None:
    """The residual of another one is below the least variance of a noise model as well."""
    t = DT / FINE * np.arange(SAMPLES * FINE)
    u = np.sin(2.0 * np.pi * 0.4 * t) + np.sin(2.0 * np.pi * 0.7 * t + 1.0)
    y = simulate_finely(np.interp(t, t[::FINE], u[::FINE]))
    fit, target = calibrate_to(recorded(u[::FINE], y, DT, ("N", "m")), oscillator())
    target = replace(target, resolution=1e-6 * float(np.ptp(y)))
    core = select_intersample(calibrate(fit.simulation, target, fit.values), target)
    assert get_intersample(core) == InterSample.FOH
    simulation = ExtendedSimulator(core, (), fit.simulation.context)
    assert target.is_matched(calibrate(simulation, target, fit.values).output)


@pytest.mark.parametrize("delay", [4, -12])
def test_lead_of_an_output_is_as_small_as_the_record_permits(delay: int) -> None:
    """A hold is half a sample late, so that a shorter delay is a lead there, and a lead is longer."""
    t = DT / FINE * np.arange(SAMPLES * FINE)
    fine_u = sum(np.sin(2 * np.pi * f * t + f) for f in (0.7, 1.9, 3.1, 4.3))
    y = add_noise(simulate_finely(np.roll(fine_u, delay)))
    record = recorded(fine_u[::FINE], y, DT, ("N", "m"))
    base, target = calibrate_to(record, ResampledSimulator(oscillator(), InterSample.ZOH, 1))
    fit = screen_effects(base, target, DiagnosisRun([DELAY]))[0].fit
    lead = float(fit.values[fit.simulation.get_slice(DELAY)][0])
    assert lead == pytest.approx((delay / FINE - 0.5) * DT, abs=0.1 * DT)
    assert get_intersample(select_intersample(fit, target)) != InterSample.ZOH


def test_a_simulation_that_smaller_steps_do_not_improve_keeps_its_step() -> None:
    """The error of a chaotic simulation after a long time does not depend on the step."""
    lorenz = {
        "name": "lorenz",
        "input": "u",
        "equations": "dx/dt = s*(y - x) + u\ndy/dt = x*(28 - z) - y\ndz/dt = x*y - 8/3*z",
        "output": "x",
        "parameters": {"s": 10.0},
        "states": {"x": {"initial": 1.0}, "y": {"initial": 1.0}, "z": {"initial": 20.0}},
    }
    record = recorded(
        np.zeros(4000) + 1e-3 * np.sin(np.arange(4000)), np.random.default_rng(1).standard_normal(4000)
    )
    simulator = make_ode_simulator(make_system(lorenz), record)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, 3000))
    target = Target(record.y, np.arange(4000) < 3000, None, {}, fitted=3000)
    selected = select_intersample(evaluate_fit(simulation, target, simulation.nominal), target)
    steps = selected.oversampling if isinstance(selected, ResampledSimulator) else 1
    assert steps == 1


def test_a_step_is_enlarged_as_far_as_the_output_remains_that_of_the_fit() -> None:
    u, fine = make_inputs(InterSample.FOH)
    y = simulate_finely(fine)
    noise = 0.01 * np.std(y) * np.random.default_rng(0).standard_normal(y.size)
    core = ResampledSimulator(oscillator(), InterSample.FOH, 8)
    fit, _ = calibrate_to(recorded(u, y + noise, DT), core)
    larger = enlarge_step(fit)
    assert get_discretisation(larger.simulation.simulator) == (InterSample.FOH, 2)
    assert np.array_equal(larger.output, larger.simulation.simulate(fit.values))
    assert np.std(larger.output - fit.output) < 0.25 * np.std(noise)
    exact = replace(fit, mean_square=1e-30)
    assert enlarge_step(exact) is exact
