"""Widths of dry friction and of steps: a record with little noise shows them, and another one does not."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.preparation import count_fitted_samples
from islands.diagnosis.calibration.smoothing_widths import narrow_friction, narrow_steps
from islands.diagnosis.calibration.target import Target
from islands.effects.baseline import JUMP
from islands.effects.friction import COULOMB_FRICTION
from islands.facade.results.saved_simulation import SavedSimulation
from islands.records.dataset import Dataset
from islands.report.documents.extension import extended_document
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.intersample import InterSample, ResampledSimulator
from islands.simulators.specification.table import LocalExtendedSpec
from support.built_in_simulators import make_oscillator

SAMPLES, DT = 900, 0.01

#: Dry friction relative to the peak of the force.
FRICTION = 0.2


def fit(width: float, noise: float, *, has_friction: bool = True) -> tuple[CalibrationResult, Target]:
    """Calibrate an oscillator with dry friction to a record with a narrower one, and a relative noise."""
    rng = np.random.default_rng(2)
    u = np.repeat(rng.standard_normal(SAMPLES // 10), 10)
    core = ResampledSimulator(make_oscillator(0.5, 2.0, 100.0), InterSample.ZOH, 4)
    samples = count_fitted_samples(Dataset(u, u, DT))
    without = scipy.signal.lsim(([1.0], [0.5, 2.0, 100.0]), u, DT * np.arange(SAMPLES))[1]
    context = make_context(Dataset(u, without, DT), core, samples)
    simulation = ExtendedSimulator(core, (COULOMB_FRICTION,) if has_friction else (), context)
    values = simulation.nominal
    if has_friction:
        values[simulation.get_slice(COULOMB_FRICTION)] = FRICTION * np.max(np.abs(u))
    narrow = replace(context.force_coordinate, friction_smoothing=width)
    true = replace(simulation, context=replace(context, force_coordinate=narrow)).simulate(values)
    y = true + noise * true.std() * rng.standard_normal(SAMPLES)
    target = Target(y, np.arange(SAMPLES) < samples, None, {}, fitted=samples)
    return calibrate(simulation, target, values), target


@pytest.mark.parametrize("width", [0.005, 0.00125])
def test_width_of_a_record_with_little_noise_is_found(width: float) -> None:
    found, target = fit(width, 1e-5)
    narrowed = narrow_friction(found, target).force_coordinate.friction_smoothing
    assert narrowed == pytest.approx(width)


def fit_jump(size: float) -> tuple[CalibrationResult, Target, Dataset]:
    """Calibrate an oscillator with a jump to a record with a sharp one, of a size relative to its noise."""
    rng = np.random.default_rng(3)
    u = rng.standard_normal(SAMPLES)
    core = ResampledSimulator(make_oscillator(0.5, 2.0, 100.0), InterSample.ZOH, 4)
    y = scipy.signal.lsim(([1.0], [0.5, 2.0, 100.0]), u, DT * np.arange(SAMPLES), interp=False)[1]
    noise = 0.02 * y.std()
    y = y + noise * rng.standard_normal(SAMPLES) + size * noise * (np.arange(SAMPLES) >= 301)
    record = Dataset(u, y, DT)
    samples = count_fitted_samples(record)
    simulation = ExtendedSimulator(core, (JUMP,), make_context(record, core, samples))
    target = Target(y, np.arange(SAMPLES) < samples, None, {}, fitted=samples)
    start = simulation.nominal
    start[simulation.get_slice(JUMP)] = size * noise, 3.05
    return calibrate(simulation, target, start), target, record


def test_jump_of_many_standard_deviations_is_a_narrow_step() -> None:
    wide, target, record = fit_jump(12.0)
    narrow = narrow_steps(wide, target)
    assert narrow.simulation.context.step_width < 1.0 < wide.simulation.context.step_width
    assert narrow.score < wide.score - 50.0
    instant = narrow.values[narrow.simulation.get_slice(JUMP)][1]
    assert instant == pytest.approx(3.005, abs=0.005)
    saved = LocalExtendedSpec.model_validate(extended_document(narrow, record))
    simulated = SavedSimulation(saved).simulate(record).y  # with other initial states
    assert simulated[299:] == pytest.approx(narrow.output[299:], abs=1e-9)


def test_jump_of_the_size_of_the_noise_keeps_its_width() -> None:
    wide, target, _ = fit_jump(1.0)
    assert narrow_steps(wide, target) is wide
