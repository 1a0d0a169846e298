"""How a core is solved: the hold and the step that made a record, and neither where nothing is to gain."""

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.intersample_selection import same_discretisation, select_intersample
from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, Target, calibrate
from islands.discrepancy.calibration.preparation import count_fitted_samples, make_context
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.bouc_wen_piezo import BoucWenPiezoSimulator
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.discrepancy.simulators.intersample import InterSample, ResampledSimulator
from islands.discrepancy.simulators.recorded_output import RecordedOutput
from islands.discrepancy.simulators.second_order import SecondOrderSimulator
from islands.systems.second_order import SecondOrder
from support.simulated_records import recorded

Array = NDArray[np.float64]

SAMPLES, DT, FINE = 800, 0.01, 20


def oscillator(m: float = 0.5, c: float = 2.0, k: float = 500.0) -> SecondOrderSimulator:
    return SecondOrderSimulator(SecondOrder(m, c, k), ("N", "m"), 0.05)


def moved(u: Array, m: float = 0.5, c: float = 2.0, k: float = 500.0, straight: bool = True) -> Array:
    """Return every ``FINE``-th sample of the motion under an input that is as fine, straight or in steps."""
    t = DT / FINE * np.arange(u.size)
    return np.asarray(scipy.signal.lsim(([1.0], [m, c, k]), u, t, interp=straight)[1])[::FINE]


def inputs(hold: InterSample) -> tuple[Array, Array]:
    """Return an input as it is sampled, and as it was between its samples."""
    t = DT / FINE * np.arange(SAMPLES * FINE)
    rng = np.random.default_rng(5)
    if hold == InterSample.BAND_LIMITED:
        lines = rng.uniform(0.3, 38.0, 40), rng.uniform(0, 2 * np.pi, 40)
        u = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(*lines, strict=True))
        return u[::FINE], u
    u = rng.standard_normal(SAMPLES)
    if hold == InterSample.ZOH:
        return u, np.repeat(u, FINE)
    return u, np.interp(np.arange(t.size) / FINE, np.arange(SAMPLES), u)


def fitted(record: Dataset, core: Simulator) -> tuple[CalibrationResult, Target]:
    samples = count_fitted_samples(record)
    simulation = ExtendedSimulator(core, (), make_context(record, core, samples))
    target = Target(record.y, np.arange(record.samples) < samples, None, {})
    return calibrate(simulation, target, simulation.nominal), target


def noisy(y: Array, part: float = 0.01, seed: int = 8) -> Array:
    return y + part * y.std() * np.random.default_rng(seed).standard_normal(y.size)


def way(core: Simulator) -> InterSample:
    return core.intersample if isinstance(core, ResampledSimulator) else InterSample.FOH


@pytest.mark.parametrize("hold", InterSample)
def test_the_hold_of_the_record_is_chosen(hold: InterSample) -> None:
    u, between = inputs(hold)
    fit, target = fitted(
        recorded(u, noisy(moved(between, straight=hold != InterSample.ZOH)), DT, ("N", "m")), oscillator()
    )
    assert way(select_intersample(fit, target)) == hold
    again = fit
    for _ in range(2):  # beside what the right hold leaves, steps have to be finer
        core = select_intersample(again, target)
        again = calibrate(ExtendedSimulator(core, (), fit.simulation.context), target, again.values)
    assert again.mean_square == pytest.approx((0.01 * target.y.std()) ** 2, rel=0.2)
    assert again.values[:3] == pytest.approx((0.5, 2.0, 500.0), rel=0.02)
    # Who has found it stays with it.
    assert way(select_intersample(again, target)) == hold


@pytest.mark.parametrize("hold", [InterSample.ZOH, InterSample.BAND_LIMITED])
def test_a_wrong_hold_leaves_more_than_the_noise(hold: InterSample) -> None:
    u, between = inputs(hold)
    fit, target = fitted(
        recorded(u, noisy(moved(between, straight=hold != InterSample.ZOH), 0.003), DT, ("N", "m")),
        oscillator(),
    )
    assert fit.mean_square > 4 * (0.003 * target.y.std()) ** 2


def test_steps_are_halved_until_that_changes_nothing() -> None:
    """Six samples a period: one step a sample is far too coarse."""
    stiff = (0.5, 2.0, 5500.0)
    u, between = inputs(InterSample.FOH)
    y = noisy(moved(between, *stiff), 0.002)
    fit, target = fitted(recorded(u, y, DT, ("N", "m")), oscillator(*stiff))
    core = select_intersample(fit, target)
    assert isinstance(core, ResampledSimulator)
    assert core.intersample == InterSample.FOH
    assert core.oversampling >= 2
    again = calibrate(ExtendedSimulator(core, (), fit.simulation.context), target, fit.values)
    assert again.values[:3] == pytest.approx(stiff, rel=0.01)
    assert again.mean_square < 0.3 * fit.mean_square


@pytest.mark.parametrize("seed", range(8))
def test_a_slow_record_is_left_to_the_core_as_it_is(seed: int) -> None:
    """Where an input hardly changes from sample to sample, no hold is better by more than chance."""
    t = DT / FINE * np.arange(SAMPLES * FINE)
    u = np.sin(2 * np.pi * 0.6 * t) + 0.5 * np.sin(2 * np.pi * 1.1 * t)
    core = oscillator(k=50.0)
    fit, target = fitted(recorded(u[::FINE], noisy(moved(u, k=50.0), seed=seed), DT, ("N", "m")), core)
    assert select_intersample(fit, target) is core


def test_a_core_that_is_not_integrated_in_steps_is_left_alone() -> None:
    u, _ = inputs(InterSample.ZOH)
    core = RecordedOutput("theirs", u)
    fit, target = fitted(recorded(u, noisy(u)), core)
    assert select_intersample(fit, target) is core


def test_ways_are_alike_or_not() -> None:
    core = BoucWenPiezoSimulator()
    assert same_discretisation(core, core)
    assert same_discretisation(core, ResampledSimulator(core, InterSample.FOH, 1))
    assert not same_discretisation(core, ResampledSimulator(core, InterSample.ZOH, 1))
    assert not same_discretisation(
        ResampledSimulator(core, InterSample.ZOH, 2), ResampledSimulator(core, InterSample.ZOH, 4)
    )
