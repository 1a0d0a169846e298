"""Trial of an extended simulation over the intervals of its parameters, and with other inputs."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.diagnosis.calibration.intersample_selection import get_discretisation
from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    evaluate_fit,
)
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.extension_trial import (
    INPUT_FACTOR,
    ExtensionTrial,
    refine_extension,
    try_extension,
)
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import Parameter
from islands.effects.interface.effect import Effect, Site
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import PythonFunctionSimulator
from islands.simulators.interface import Simulator
from islands.simulators.intersample import InterSample, ResampledSimulator
from islands.simulators.specification.factory import make_simulator
from lab.diagnosis.injection.unusual.table import UNUSUAL_CAUSES
from lab.diagnosis.unusual_trial import draw_record

#: Input.
SIGNAL = lfilter([0.3], [1.0, -0.7], np.random.default_rng(0).standard_normal(400))

#: A gain that grows with the input without a limit: u exp(s |u| / peak).
RUNAWAY = Effect(
    name="runaway",
    summary="a gain without a limit",
    family="shape",
    site=Site.INPUT,
    parameters=lambda _: (Parameter("s", "", 0.0, 0.01),),
    starting_points=lambda _context, _residual: ((0.1,),),
    form=lambda u, values, _: u * np.exp(values[0] * np.abs(u) / np.abs(SIGNAL).max()),
    source="none",
)


def copy_input(u: np.ndarray, dt: float) -> np.ndarray:
    return u + 0.0 * dt


def try_runaway(s: float, noise: float, simulator: Simulator | None = None) -> ExtensionTrial:
    """Try an extension with an effect of known strength, which the noise of the record makes uncertain."""
    rng, u = np.random.default_rng(1), SIGNAL
    peak = float(np.abs(u).max())
    y = u * np.exp(s * np.abs(u) / peak) + noise * rng.standard_normal(u.size)
    record = Dataset(u, y, 0.1, ("u_V",), "y_um", ("V",), "um")
    fitted = count_fitted_samples(record)
    simulator = simulator or PythonFunctionSimulator(copy_input, "copy")
    target = make_target(record, fitted, {})
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, fitted))
    base = calibrate(simulation, target, simulation.nominal)
    best = evaluate_fit(simulation.with_effects([RUNAWAY]), target, np.array([s]))
    return try_extension(record, base, best, target)


def test_extension_within_its_record_is_offered_with_its_ranges() -> None:
    trial = try_runaway(3.0, 1e-3)
    assert (trial.refusal, trial.input_factor) == (None, INPUT_FACTOR)
    u, y = trial.ranges
    assert (u.name, u.unit, y.name, y.unit) == ("u_V", "V", "y_um", "um")
    assert u.low < 0.0 < u.high
    assert u.rate > (u.high - u.low) / 40.0
    assert y.high - y.low > u.high - u.low


def rise_at_falls(u: np.ndarray, values: np.ndarray, _: object) -> np.ndarray:
    """Return a signal to which a fast fall adds much; the reverse of a sawtooth falls fast."""
    return u + values[0] * 1e3 * np.maximum(-np.diff(u, prepend=u[0]) - 1.0, 0.0)


def rise_with_mean(u: np.ndarray, values: np.ndarray, _: object) -> np.ndarray:
    """Return a signal to which a large mean adds much."""
    return u + values[0] * 1e3 * max(float(u.mean()) - 1.0, 0.0)


def make_rare_peaks() -> tuple[Dataset, CalibrationResult, Target]:
    """Return a record whose input rises fast, falls slowly, and is small for most of the time."""
    phase = np.arange(400) % 40
    u = np.where(phase < 2, 1.8 * phase, 3.6 * ((40 - phase) / 38) ** 4) - 0.6
    record = Dataset(u, 1.01 * u + 0.01 * np.random.default_rng(1).standard_normal(400), 0.1)
    simulator, target = PythonFunctionSimulator(copy_input, "copy"), make_target(record, 300, {})
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, 300))
    return record, calibrate(simulation, target, simulation.nominal), target


@pytest.mark.parametrize(
    ("form", "description"),
    [(rise_at_falls, "in reverse order"), (rise_with_mean, "mirrored within its range")],
)
def test_extension_that_diverges_with_another_input_is_refused(form, description: str) -> None:
    record, base, target = make_rare_peaks()
    effect = replace(RUNAWAY, form=form)
    best = evaluate_fit(base.simulation.with_effects([effect]), target, np.array([1.0]))
    assert best.mean_square < 1.0
    trial = try_extension(record, base, best, target)
    assert trial.refusal is not None
    assert f"with the recorded input {description}" in trial.refusal
    assert trial.is_unstable


def test_term_that_diverges_with_another_input_is_refused() -> None:
    """A term is a part of the extended equations, and not of the simulation without it."""
    record, base, target = make_rare_peaks()

    def extended(u: np.ndarray, dt: float, a1: float = 0.5) -> np.ndarray:
        return rise_with_mean(copy_input(u, dt), np.array([a1]), None)

    simulation = replace(base.simulation, simulator=PythonFunctionSimulator(extended, "extended"))
    trial = try_extension(record, base, evaluate_fit(simulation, target, np.array([1.0])), target)
    assert trial.refusal is not None
    assert "mirrored" in trial.refusal


@pytest.mark.parametrize("scale", [1.0, 30.0])
def test_excursion_of_the_simulation_without_the_extension_is_allowed(scale: float) -> None:
    """An output that is small because two parts of it cancel: the simulation alone is larger."""
    rng = np.random.default_rng(1)
    u = rng.standard_normal(400)
    record = Dataset(u, 0.01 * rng.standard_normal(400), 0.1)
    simulator = PythonFunctionSimulator(lambda u, dt, k=scale: k * u + 0.0 * dt, "gain")
    target = make_target(record, 300, {"k": 1e-3})
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, 300))
    base = evaluate_fit(simulation, target, simulation.nominal)
    best = evaluate_fit(simulation.with_effects([CATALOGUE["offset"]]), target, np.array([scale, 0.0]))
    assert try_extension(record, base, best, target).refusal is None
    loud = replace(best, values=np.array([scale, 40.0 * scale * float(np.ptp(u))]))
    assert try_extension(record, base, loud, target).refusal is not None


@pytest.mark.ci
def test_force_that_settles_within_a_step_is_offered_with_smaller_steps() -> None:
    measured, _ = draw_record(UNUSUAL_CAUSES["dahl-friction"], 8100000)
    record = measured.record
    fitted = count_fitted_samples(record)
    simulator = ResampledSimulator(make_simulator("second-order", record), InterSample.BAND_LIMITED, 2)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, fitted))
    target = make_target(record, fitted, {})
    base = calibrate(simulation, target, simulation.nominal)
    extended = simulation.with_effects([CATALOGUE["second-hysteresis"]])
    start = [0.8, 8.0, 2000.0, *base.values[3:], 2120.0, 1890.0, -160.0, 0.0]
    best = calibrate(extended, target, np.array(start))
    refused = try_extension(record, base, best, target)
    assert refused.refusal is not None
    assert "it diverges" in refused.refusal
    refined, trial = refine_extension(record, base, best, target)
    assert trial.refusal is None
    np.testing.assert_array_equal(refined.values, best.values)
    assert get_discretisation(refined.simulation.simulator) == (InterSample.BAND_LIMITED, 4)
