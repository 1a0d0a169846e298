"""Causes that do the same: slips that are quicker than samples, and play."""

import numpy as np
import pytest
from numpy.typing import NDArray

from islands.discrepancy.calibration.levenberg_marquardt import Target, calibrate
from islands.discrepancy.calibration.preparation import make_context
from islands.discrepancy.effects import CATALOGUE
from islands.discrepancy.inference.confounders import Confounder, find_confounder
from islands.discrepancy.inference.screening import screen_effects
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.discrepancy.simulators.linear import LinearSimulator
from islands.systems.hysteresis_operators import play_from, slider
from support.simulated_records import recorded

Array = NDArray[np.float64]

#: A simulation that does what its input does.
STIFF = LinearSimulator(np.ones(1), np.zeros(0), 0.0, 0, "um")


def test_slips_leave_a_play_of_half_the_breakaway_on_the_average() -> None:
    """Where a slip begins is chance: over all of them their mean is the play, at every instant."""
    time = np.arange(4000) * 1e-3
    breakaway = 0.4
    paths, plays = [], []
    for start in np.linspace(0.0, breakaway, 200, endpoint=False):
        u = 5.0 * np.sin(2 * np.pi * 0.5 * time)
        # The slider is somewhere within its breakaway when the record begins.
        x = np.empty(u.size + 1)
        slider(np.concatenate([[u[0] - start], u]), breakaway, x)
        paths.append(x[1:])
        plays.append(play_from(u, breakaway / 2))
    behind = slice(1500, None)  # the first reversal mixes where they are
    difference = np.mean(paths, axis=0)[behind] - np.mean(plays, axis=0)[behind]
    spread = np.std(np.array(paths)[:, behind] - np.array(plays)[:, behind])
    assert np.std(difference) < 0.35 * spread


def slipped(u: Array, breakaway: float) -> Array:
    """Follow in slips."""
    moved = np.empty_like(u)
    slider(u, breakaway, moved)
    return moved


@pytest.fixture(scope="module")
def fast() -> Array:
    """An input at 1 kHz that is slow for some of the time: only there slips last longer than a sample."""
    time = np.arange(60_000) * 1e-3
    return sum(a * np.sin(2 * np.pi * f * time + f) for a, f in ((5.0, 0.31), (3.0, 0.53), (2.0, 0.83)))


def asked(u: Array, y: Array, name: str) -> Confounder | None:
    """Fit an effect, and ask what it is like."""
    record = recorded(u, y)
    simulation = ExtendedSimulator(STIFF, (), make_context(record, STIFF, u.size))
    target = Target(y, np.ones(u.size, dtype=bool), None, {})
    base = calibrate(simulation, target, simulation.nominal)
    return find_confounder(screen_effects(base, target, [CATALOGUE[name]])[0].fit, CATALOGUE[name], target)


def compared(fast: Array, moved: Array, noise: float, seed: int) -> Confounder:
    """Fit a play to one sample in ten, and return what is said of slips in its place."""
    chance = np.random.default_rng(seed).standard_normal(fast.size // 10)
    found = asked(fast[::10], moved[::10] + noise * chance, "backlash")
    assert found is not None
    return found


@pytest.mark.parametrize("seed", range(4))
def test_slips_are_told_from_play_by_how_neighbours_go_together(fast: Array, seed: int) -> None:
    slips = compared(fast, slipped(fast, 0.4), 0.1, seed)
    play = compared(fast, play_from(fast, 0.2), 0.1, seed)
    assert (slips.effect.name, slips.factor) == ("stiction", 2.0)
    assert slips.gained > 9.0
    assert play.gained < -9.0
    assert slips.beside == pytest.approx(0.4**2 / 12, rel=0.3)


@pytest.mark.parametrize("seed", range(4))
def test_slips_that_noise_buries_say_nothing(fast: Array, seed: int) -> None:
    for moved in (slipped(fast, 0.1), play_from(fast, 0.05)):
        assert abs(compared(fast, moved, 0.5, seed).gained) < 4.0


def test_what_is_like_nothing_else_is_not_asked(fast: Array) -> None:
    assert asked(fast[::10], fast[7::10], "delay") is None
