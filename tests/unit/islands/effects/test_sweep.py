"""Disturbances that sweep: found in noise, behind a system, and named by the place where they act."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import islands
from islands.effects.sweep import (
    find_sweep,
)

DT, SAMPLES = 0.005, 2000


def make_wave(first: float, last: float, samples: int = SAMPLES) -> np.ndarray:
    """Return a sweep between two frequencies in Hz."""
    time = DT * np.arange(samples)
    return np.asarray(np.sin(2 * np.pi * (first * time + (last - first) * time**2 / (2 * time[-1])) + 0.7))


def draw_input(seed: int, samples: int = SAMPLES) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal(samples)
    return np.asarray(lfilter([0.2], [1.0, -0.8], noise))


def move(force: np.ndarray) -> np.ndarray:
    """Return the response of a mass of 8 Hz with a damping ratio of 0.1 to a force."""
    w = 2 * np.pi * 8.0
    b, a, _ = cont2discrete(([w * w], [1.0, 0.2 * w, w * w]), DT, method="foh")
    return np.asarray(lfilter(np.ravel(b), a, force))


@pytest.mark.parametrize(("first", "last"), [(0.5, 15.0), (60.0, 10.0), (30.0, 33.0)])
@pytest.mark.parametrize("samples", [900, 2000, 9000])
def test_a_sweep_is_found_in_noise(first: float, last: float, samples: int) -> None:
    signal = 0.3 * make_wave(first, last, samples) + np.random.default_rng(1).standard_normal(samples)
    found = find_sweep(signal - signal.mean(), None, 4.0)
    assert found is not None
    resolution = 1.0 / (samples * DT)
    assert found.frequency / DT == pytest.approx(first, abs=1.5 * resolution)
    end = found.frequency / DT + found.rate / DT**2 * samples * DT
    assert end == pytest.approx(last, abs=2.0 * resolution)


def diagnose(u: np.ndarray, y: np.ndarray) -> islands.DiagnosisResult:
    noise = 0.01 * y.std() * np.random.default_rng(6).standard_normal(y.size)
    record = islands.Dataset(u[:, None], y + noise, DT, ("F_N",), "x_mm", ("N",), "mm")
    return islands.diagnose(record, "second-order")


@pytest.mark.ci
@pytest.mark.parametrize("acts_at_input", [True, False])
def test_a_sweep_is_named_by_the_place_where_it_acts(acts_at_input: bool) -> None:
    u, wave = draw_input(7), make_wave(0.5, 15.0)
    y = move(u + 0.1 * wave) if acts_at_input else move(u) + 0.05 * wave
    found = diagnose(u, y)
    name = "swept-disturbance" if acts_at_input else "swept-interference"
    assert (str(found.verdict), found.claimed_names) == ("named", (name,))
    assert found.effects[0].confidence > 0.9
    values = found.effects[0].parameters
    assert values["frequency"].value == pytest.approx(0.5, abs=0.01)
    assert values["rate"].value == pytest.approx(14.5 / (SAMPLES * DT), abs=0.01)
    assert f"{name} sweeps from 0." in found.summary
    assert found.effects[0].depends_on_time
