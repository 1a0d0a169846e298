"""Tests before a coloured residual is called noise."""

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.hidden_structure import find_hidden_structure
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.factory import make_simulator
from support.noise_records import (
    DT,
    SAMPLES,
    draw_input,
    make_noisy_record,
    respond,
)
from support.simulated_records import recorded


def fit(record: Dataset, order: int = 2) -> tuple[CalibrationResult, Target]:
    fitted = count_fitted_samples(record)
    target = make_target(record, fitted, {})
    simulator = make_simulator(f"linear:{order}", record)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, fitted))
    return calibrate(simulation, target, simulation.nominal), target


def find(record: Dataset, order: int = 2) -> dict[str, float]:
    return dict(find_hidden_structure(*fit(record, order), np.random.default_rng(0)))


@pytest.mark.parametrize("seed", range(2))
def test_law_of_the_state_is_a_map_of_the_output(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, x, y = 0.2 * draw_input(rng), 0.0, np.empty(SAMPLES)
    for k in range(SAMPLES):
        y[k] = x
        x += 0.05 * (u[k] - x - 0.3 * abs(x) * x)
    noise = np.asarray(lfilter([1.0], [1.0, -0.9], rng.standard_normal(SAMPLES)))
    assert "map of the output" in find(recorded(u, y + 0.01 * y.std() * noise / noise.std(), DT), 1)


@pytest.mark.ci
@pytest.mark.parametrize("noise", ["slow", "in band", "pink", "steps"])
def test_clean_noise_has_no_structure(noise: str) -> None:
    assert not any(find(make_noisy_record(noise, seed)) for seed in range(4))


@pytest.mark.ci
def test_error_that_repeats_with_the_periods_is_no_noise() -> None:
    rng = np.random.default_rng(0)
    phases = rng.uniform(0.0, 2 * np.pi, (2, 12))
    time = 2 * np.pi * np.arange(250) / 250
    u, error = (np.sin(np.outer(time, range(1, 13)) + each).sum(axis=1) for each in phases)
    noise = 0.05 * np.asarray(lfilter([1.0], [1.0, -0.9], rng.standard_normal(SAMPLES)))
    u, error = np.tile(u, 8), np.tile(error, 8)
    y = respond(u) + noise
    assert "period of the input" not in find(recorded(u, y, DT))
    assert "period of the input" in find(recorded(u, y + 0.08 * error, DT))
