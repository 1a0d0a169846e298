"""How a core is solved: the hold and the step that made a record, and neither where nothing is to gain."""

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.intersample_selection import settled, solved_alike
from islands.discrepancy.calibration.levenberg_marquardt import Calibrated, Target, calibrate
from islands.discrepancy.calibration.preparation import fitted_samples, scene_of
from islands.discrepancy.interfaces.simulator import Core
from islands.discrepancy.simulators.bouc_wen_piezo import BoucWenPiezoCore
from islands.discrepancy.simulators.extended import Extended
from islands.discrepancy.simulators.intersample import Between, Hold
from islands.discrepancy.simulators.recorded_output import ColumnCore
from islands.discrepancy.simulators.second_order import SecondOrderCore
from islands.systems.second_order import SecondOrder
from support.simulated_records import recorded

Array = NDArray[np.float64]

SAMPLES, DT, FINE = 800, 0.01, 20


def oscillator(m: float = 0.5, c: float = 2.0, k: float = 500.0) -> SecondOrderCore:
    return SecondOrderCore(SecondOrder(m, c, k), ("N", "m"), 0.05)


def moved(u: Array, m: float = 0.5, c: float = 2.0, k: float = 500.0, straight: bool = True) -> Array:
    """Return every ``FINE``-th sample of the motion under an input that is as fine, straight or in steps."""
    t = DT / FINE * np.arange(u.size)
    return np.asarray(scipy.signal.lsim(([1.0], [m, c, k]), u, t, interp=straight)[1])[::FINE]


def inputs(hold: Hold) -> tuple[Array, Array]:
    """Return an input as it is sampled, and as it was between its samples."""
    t = DT / FINE * np.arange(SAMPLES * FINE)
    rng = np.random.default_rng(5)
    if hold == Hold.BAND:
        lines = rng.uniform(0.3, 38.0, 40), rng.uniform(0, 2 * np.pi, 40)
        u = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(*lines, strict=True))
        return u[::FINE], u
    u = rng.standard_normal(SAMPLES)
    if hold == Hold.ZERO:
        return u, np.repeat(u, FINE)
    return u, np.interp(np.arange(t.size) / FINE, np.arange(SAMPLES), u)


def fitted(record: Dataset, core: Core) -> tuple[Calibrated, Target]:
    samples = fitted_samples(record)
    simulation = Extended(core, (), scene_of(record, core, samples))
    target = Target(record.y, np.arange(record.samples) < samples, None, {})
    return calibrate(simulation, target, simulation.nominal), target


def noisy(y: Array, part: float = 0.01, seed: int = 8) -> Array:
    return y + part * y.std() * np.random.default_rng(seed).standard_normal(y.size)


def way(core: Core) -> Hold:
    return core.hold if isinstance(core, Between) else Hold.FIRST


@pytest.mark.parametrize("hold", Hold)
def test_the_hold_of_the_record_is_chosen(hold: Hold) -> None:
    u, between = inputs(hold)
    fit, target = fitted(
        recorded(u, noisy(moved(between, straight=hold != Hold.ZERO)), DT, ("N", "m")), oscillator()
    )
    assert way(settled(fit, target)) == hold
    again = fit
    for _ in range(2):  # beside what the right hold leaves, steps have to be finer
        core = settled(again, target)
        again = calibrate(Extended(core, (), fit.simulation.scene), target, again.values)
    assert again.mean_square == pytest.approx((0.01 * target.y.std()) ** 2, rel=0.2)
    assert again.values[:3] == pytest.approx((0.5, 2.0, 500.0), rel=0.02)
    # Who has found it stays with it.
    assert way(settled(again, target)) == hold


@pytest.mark.parametrize("hold", [Hold.ZERO, Hold.BAND])
def test_a_wrong_hold_leaves_more_than_the_noise(hold: Hold) -> None:
    u, between = inputs(hold)
    fit, target = fitted(
        recorded(u, noisy(moved(between, straight=hold != Hold.ZERO), 0.003), DT, ("N", "m")), oscillator()
    )
    assert fit.mean_square > 4 * (0.003 * target.y.std()) ** 2


def test_steps_are_halved_until_that_changes_nothing() -> None:
    """Six samples a period: one step a sample is far too coarse."""
    stiff = (0.5, 2.0, 5500.0)
    u, between = inputs(Hold.FIRST)
    y = noisy(moved(between, *stiff), 0.002)
    fit, target = fitted(recorded(u, y, DT, ("N", "m")), oscillator(*stiff))
    core = settled(fit, target)
    assert isinstance(core, Between)
    assert core.hold == Hold.FIRST
    assert core.times >= 2
    again = calibrate(Extended(core, (), fit.simulation.scene), target, fit.values)
    assert again.values[:3] == pytest.approx(stiff, rel=0.01)
    assert again.mean_square < 0.3 * fit.mean_square


@pytest.mark.parametrize("seed", range(8))
def test_a_slow_record_is_left_to_the_core_as_it_is(seed: int) -> None:
    """Where an input hardly changes from sample to sample, no hold is better by more than chance."""
    t = DT / FINE * np.arange(SAMPLES * FINE)
    u = np.sin(2 * np.pi * 0.6 * t) + 0.5 * np.sin(2 * np.pi * 1.1 * t)
    core = oscillator(k=50.0)
    fit, target = fitted(recorded(u[::FINE], noisy(moved(u, k=50.0), seed=seed), DT, ("N", "m")), core)
    assert settled(fit, target) is core


def test_a_core_that_is_not_integrated_in_steps_is_left_alone() -> None:
    u, _ = inputs(Hold.ZERO)
    core = ColumnCore("theirs", u)
    fit, target = fitted(recorded(u, noisy(u)), core)
    assert settled(fit, target) is core


def test_ways_are_alike_or_not() -> None:
    core = BoucWenPiezoCore()
    assert solved_alike(core, core)
    assert solved_alike(core, Between(core, Hold.FIRST, 1))
    assert not solved_alike(core, Between(core, Hold.ZERO, 1))
    assert not solved_alike(Between(core, Hold.ZERO, 2), Between(core, Hold.ZERO, 4))
