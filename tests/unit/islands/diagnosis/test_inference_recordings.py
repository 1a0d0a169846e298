"""Analyses of a residual: none of them reaches from one recording into the next."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, evaluate_fit
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.holdout import cross_validate_gain
from islands.diagnosis.inference.noise_detectors import DETECTORS, NoiseFinding
from islands.diagnosis.inference.residual_structure import find_residual_structure
from islands.diagnosis.inference.stepwise_search import MIN_GAIN
from islands.diagnosis.inference.verdict import choose_reference_fit
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import SimulationContext
from islands.records.dataset import join
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.extended import make_context as make_record_context
from islands.simulators.linear import LinearSimulator
from islands.simulators.specification.factory import make_simulator
from support.simulated_records import made

LENGTHS = (400, 300, 300)

SAMPLES = sum(LENGTHS)


def make_context(u: np.ndarray, lengths: tuple[int, ...] = LENGTHS) -> SimulationContext:
    return SimulationContext(u, 0.01, {}, {}, 1.0, 1.0, "V", "um", u.size * 0.01, segments=lengths)


def draw_inputs(seed: int = 1) -> list[np.ndarray]:
    """Draw slow inputs at different levels, so that a boundary is a large step."""
    rng = np.random.default_rng(seed)
    return [
        10.0 * number + scipy.signal.lfilter([0.02], [1.0, -0.98], rng.standard_normal(length))
        for number, length in enumerate(LENGTHS)
    ]


def detect(name: str, y: np.ndarray, residual: np.ndarray, lengths: tuple[int, ...]) -> NoiseFinding | None:
    found = DETECTORS[name].detect(y, residual, make_context(np.zeros(y.size), lengths))
    return found if found is not None and found.score_gain > MIN_GAIN else None


def test_lost_samples_end_with_a_recording() -> None:
    rng = np.random.default_rng(2)
    parts = [rng.standard_normal(length) for length in LENGTHS]
    for first, second in pairwise(parts):
        first[-2:] = second[:2] = 0.25  # two equal samples on either side are no burst of four
    y = np.concatenate(parts)
    assert detect("held-samples", y, y, (SAMPLES,)) is not None
    assert detect("held-samples", y, y, LENGTHS) is None


def test_first_samples_of_recordings_are_no_outliers() -> None:
    rng = np.random.default_rng(3)
    lengths = (100,) * 10
    drawn = rng.standard_normal((10, 1500))
    slow = scipy.signal.lfilter([1.0], [1.0, -0.995], drawn, axis=1)[:, -100:].ravel()
    assert detect("outliers", slow, slow, (1000,)) is not None
    assert detect("outliers", slow, slow, lengths) is None
    assert detect("heteroscedastic-noise", np.ones(1000), slow, lengths) is None


def test_steps_between_recordings_are_no_rate() -> None:
    rng = np.random.default_rng(6)
    lengths = (30,) * 40
    levels = 10.0 * np.cumsum(rng.choice([-1.0, 1.0], len(lengths)))
    u = np.repeat(levels, 30) + 0.01 * rng.standard_normal(1200)
    # The error at either end of a recording follows the step to its neighbour.
    residual = rng.standard_normal(1200)
    steps = np.sign(np.diff(levels))
    residual[29:-1:30] += 3.0 * steps
    residual[30::30] += 3.0 * steps
    noise = rng.standard_normal(1200)
    structure = find_residual_structure(residual, noise, make_context(u, (1200,)), np.random.default_rng(0))
    assert structure
    assert not find_residual_structure(residual, noise, make_context(u, lengths), np.random.default_rng(0))


def make_fit(segments: tuple[int, ...]) -> tuple[CalibrationResult, Target]:
    """Return the fit of a linear model with an initial state for each recording, and its target."""
    parts = draw_inputs(7)
    u = np.concatenate(parts)
    context = make_context(u, segments)
    simulator = LinearSimulator(np.array([0.1, 0.0]), np.array([0.9]), 0.0, 0.0, 0, "um")
    target = Target(np.roll(u, 3), np.arange(SAMPLES) < 750, None, {}, segments=segments, fitted=750)
    simulation = ExtendedSimulator(simulator, (), context)
    return evaluate_fit(simulation, target, simulation.nominal + 0.05), target


def test_reference_at_nominal_values_keeps_the_initial_states_of_recordings() -> None:
    fit, target = make_fit(LENGTHS)
    gain = (CATALOGUE["sensor-gain"],)
    reference = choose_reference_fit(gain, fit, target)
    names = [parameter.name for parameter in fit.simulation.parameters]
    changed = reference.values != fit.simulation.nominal
    assert [name for name, kept in zip(names, changed, strict=True) if kept] == [
        "state 1 (recording 2)",
        "state 1 (recording 3)",
    ]


def test_missing_terms_do_not_depend_on_the_order_of_recordings() -> None:
    case = made()["model"]
    parts = [replace(case.record[part], start=0.0) for part in (slice(0, 350), slice(350, 600))]
    rng = np.random.default_rng(8)
    noise = [rng.standard_normal(part.samples) for part in parts]
    found = []
    for order in (1, -1):
        record = join(tuple(parts[::order]))
        simulator = make_simulator(case.spec, record)
        (effect,) = simulator.state_effects
        context = make_record_context(record, simulator, record.samples)
        found.append(effect.starting_points(context, np.concatenate(noise[::order])))
    assert np.array(found[0]) == pytest.approx(np.array(found[1]), rel=1e-6)


def test_first_samples_of_recordings_are_never_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    fit, target = make_fit(LENGTHS)
    parts: list[np.ndarray] = []

    def record_part(_simulation: object, training: Target, _values: object) -> CalibrationResult:
        parts.append(training.estimation_part)
        return fit

    monkeypatch.setattr("islands.diagnosis.inference.holdout.calibrate", record_part)
    cross_validate_gain(fit, True, fit, target, np.random.default_rng(0))
    fitted = np.array(parts)
    for first in (0, 400, 700):
        assert fitted[:, first : first + 20].all()
    # Every other sample is left out of one of the three fits.
    assert np.count_nonzero(~fitted[:, :750]) == 750 - (21 + 21 + 21)
