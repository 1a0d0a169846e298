"""Confounders: stick-slip with slips shorter than a sample, and play."""

import numpy as np
import pytest
from numpy.typing import NDArray

from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.confounders import Confounder, find_confounder
from islands.diagnosis.inference.screening import screen_effects
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CATALOGUE
from islands.kernels.memory_operators import play_from, slider
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import PythonFunctionSimulator
from islands.simulators.interface import Simulator
from islands.simulators.linear import LinearSimulator
from support.simulated_records import recorded

Array = NDArray[np.float64]

#: A simulation whose output is its input.
UNIT_GAIN = LinearSimulator(np.ones(1), np.zeros(0), 0.0, 0.0, 0, "um")


def test_mean_response_of_stick_slip_is_play_of_half_the_breakaway() -> None:
    """Slips begin at random: their mean over all starts is the play at every instant."""
    time = np.arange(4000) * 1e-3
    breakaway = 0.4
    paths, plays = [], []
    for start in np.linspace(0.0, breakaway, 200, endpoint=False):
        u = 5.0 * np.sin(2 * np.pi * 0.5 * time)
        # The initial position of the slider is anywhere within its breakaway.
        x = np.empty(u.size + 1)
        slider(np.concatenate([[u[0] - start], u]), breakaway, x)
        paths.append(x[1:])
        plays.append(play_from(u, breakaway / 2))
    mixed = slice(1500, None)  # after the first reversal the positions are mixed
    difference = np.mean(paths, axis=0)[mixed] - np.mean(plays, axis=0)[mixed]
    std = np.std(np.array(paths)[:, mixed] - np.array(plays)[:, mixed])
    assert np.std(difference) < 0.35 * std


def stick_slip(u: Array, breakaway: float) -> Array:
    """Return a motion that follows the input by stick-slip."""
    x = np.empty_like(u)
    slider(u, breakaway, x)
    return x


@pytest.fixture(scope="module")
def fine_u() -> Array:
    """An input at 1 kHz that is slow at times, so that some slips last longer than a sample."""
    time = np.arange(60_000) * 1e-3
    return sum(a * np.sin(2 * np.pi * f * time + f) for a, f in ((5.0, 0.31), (3.0, 0.53), (2.0, 0.83)))


def fit_and_find(u: Array, y: Array, name: str, simulator: Simulator = UNIT_GAIN) -> Confounder | None:
    """Fit an effect and return its confounder."""
    record = recorded(u, y)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, u.size))
    target = Target(y, np.ones(u.size, dtype=bool), None, {}, fitted=u.size)
    base = calibrate(simulation, target, simulation.nominal)
    return find_confounder(
        screen_effects(base, target, DiagnosisRun([CATALOGUE[name]]))[0].fit, CATALOGUE[name], target
    )


def fit_play(fine_u: Array, x: Array, noise: float, seed: int) -> Confounder:
    """Fit a play to one sample in ten and return its confounder, stick-slip."""
    white = np.random.default_rng(seed).standard_normal(fine_u.size // 10)
    found = fit_and_find(fine_u[::10], x[::10] + noise * white, "backlash")
    assert found is not None
    return found


@pytest.mark.parametrize("seed", range(4))
def test_stick_slip_and_play_differ_in_serial_correlation(fine_u: Array, seed: int) -> None:
    stick = fit_play(fine_u, stick_slip(fine_u, 0.4), 0.1, seed)
    play = fit_play(fine_u, play_from(fine_u, 0.2), 0.1, seed)
    assert (stick.effect.name, stick.factor) == ("stiction", 2.0)
    assert stick.score_gain > 9.0
    assert play.score_gain < -9.0
    assert stick.excess_mean_square == pytest.approx(0.4**2 / 12, rel=0.3)


def test_confounder_with_which_the_simulation_diverges_is_none(fine_u: Array) -> None:
    def diverge_at_jumps(u: Array, _dt: float) -> Array:
        return u if np.abs(np.diff(u)).max() < 0.2 else np.full_like(u, np.nan)

    u = fine_u[:20_000:5]
    simulator = PythonFunctionSimulator(diverge_at_jumps, "diverge_at_jumps")
    y = play_from(u, 0.4) + 0.02 * np.random.default_rng(1).standard_normal(u.size)
    assert fit_and_find(u, y, "backlash") is not None
    assert fit_and_find(u, y, "backlash", simulator) is None
