"""Repeated periods: found where there are any, and the noise that they tell."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.discrepancy.inference.noise_floor import SHORTEST, detect_period, noise_variance_from_periods

Array = NDArray[np.float64]


def periodic(period: int, samples: int, seed: int = 0) -> Array:
    """Return a signal of a random period, without one shorter than that."""
    one = np.random.default_rng(seed).standard_normal(period)
    return np.resize(one, samples)


@given(st.integers(SHORTEST, 120), st.floats(2.0, 9.0), st.integers(0, 99), st.floats(-50, 50))
def test_a_period_is_found_to_the_sample(period: int, times: float, seed: int, offset: float) -> None:
    samples = int(np.ceil(period * times)) + 1
    assert detect_period(offset + periodic(period, samples, seed)) == period


@given(st.floats(0.01, 100.0), st.integers(0, 20))
def test_a_period_is_found_whatever_the_unit_and_where_it_is_a_little_off(size: float, seed: int) -> None:
    u = periodic(64, 500, seed)
    off = 2e-4 * np.random.default_rng(seed).standard_normal(u.size)
    assert detect_period(size * (u + off)) == 64


def test_a_smooth_period_is_the_shortest_one() -> None:
    t = np.arange(2000)
    assert detect_period(np.sin(2 * np.pi * t / 100) + np.sin(2 * np.pi * t / 40 + 1)) == 200


@pytest.mark.parametrize("seed", range(10))
def test_what_does_not_repeat_itself_has_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal(3000)
    walk = np.cumsum(noise)
    assert detect_period(noise) is None
    assert detect_period(walk) is None
    assert noise_variance_from_periods(noise, noise) is None


def test_what_is_not_there_twice_over_has_none() -> None:
    assert detect_period(periodic(64, 120)) is None
    t = np.arange(3000)
    swept = np.sin(1e-5 * t**2)
    assert detect_period(swept) is None


def test_a_period_that_changes_by_more_than_rounding_has_none() -> None:
    u = periodic(64, 640)
    rng = np.random.default_rng(1)
    assert detect_period(u + 0.01 * rng.standard_normal(u.size)) is None


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("sigma", [1e-4, 0.3, 20.0])
def test_the_noise_is_found_within_chance(sigma: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    u = periodic(80, 2000)
    y = 5 * np.tanh(u) + np.roll(u, 3) + sigma * rng.standard_normal(u.size)
    y[:80] += 100.0 * np.exp(-np.arange(80) / 9.0)  # what was before dies away
    found = noise_variance_from_periods(u, y)
    # 23 differences of 80 samples, of which neighbours share one; each loses its level.
    expected, chance = sigma**2 * (1 - 1 / 80), 4 * (3 / (23 * 80)) ** 0.5
    assert found == pytest.approx(expected, rel=chance)


def test_a_level_that_drifts_is_no_noise() -> None:
    u = periodic(80, 2000)
    steps = np.repeat(np.arange(25.0), 80)
    assert noise_variance_from_periods(u, u + steps) == pytest.approx(0.0, abs=1e-20)


def test_two_periods_are_too_few_for_their_noise() -> None:
    u = periodic(64, 190)
    assert detect_period(u) == 64
    assert noise_variance_from_periods(u, u) is None
    assert noise_variance_from_periods(periodic(64, 192), periodic(64, 192)) == 0.0
