"""Loops of the output over the input: where they start, and whether they enclose an area."""

import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.records.loops import has_loops, loop_starts


def sine(periods: int, length: int = 100) -> Dataset:
    k = np.arange(periods * length)
    u = np.sin(2 * np.pi * k / length - 0.5)
    return Dataset(u, 2 * u, 0.01)


def respond(u: np.ndarray, pole: float = 0.8) -> Dataset:
    """Return a record of a first-order lag."""
    y = np.zeros(len(u))
    for k in range(1, len(u)):
        y[k] = pole * y[k - 1] + u[k - 1]
    return Dataset(u, y, 0.01)


@pytest.mark.parametrize("periods", [1, 7, 40])
def test_sine_has_one_loop_per_period(periods):
    assert len(loop_starts(sine(periods))) == periods


def test_a_lag_or_hysteresis_under_a_sine_is_a_loop():
    u = 3 + 5 * np.sin(2 * np.pi * np.arange(600) / 100)
    assert has_loops(respond(u))
    play = np.zeros(600)
    for k in range(1, 600):
        play[k] = np.clip(play[k - 1], u[k] - 0.3, u[k] + 0.3)
    assert has_loops(Dataset(u, play, 0.01))
    noisy = u + 0.05 * np.random.default_rng(0).standard_normal(600)
    assert has_loops(Dataset(noisy, play, 0.01))


@pytest.mark.parametrize("hold", [1, 3])
def test_fast_changes_of_the_input_make_no_loop(hold):
    u = np.repeat(np.random.default_rng(1).uniform(-1, 1, 600), hold)
    assert not has_loops(respond(u))
