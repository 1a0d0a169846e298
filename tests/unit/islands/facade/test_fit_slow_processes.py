"""Fits of processes with slow modes, which measurement noise hides from the one-step-ahead error."""

import numpy as np
import pytest

import islands
from support.slow_processes import BATTERY_NOISE, BATTERY_POLE, TANK_NOISE, make_battery, make_tank

#: Samples of a step response.
TIMES = np.arange(200)


def error(result):
    return result.best.metrics["validation"]["free_run"].rmse


def step_response(result):
    return result.linearise().step_response(TIMES.size).values[0, 0]


@pytest.mark.ci
@pytest.mark.parametrize("library", [pytest.param("auto", marks=pytest.mark.nightly), "polynomial"])
def test_level_of_a_tank_is_the_integral_of_the_flow(library):
    result = islands.fit(make_tank(1, 600), library=library)
    assert result.linearise().poles == pytest.approx([1.0], abs=1e-5)
    assert step_response(result) == pytest.approx(0.02 * TIMES, rel=6e-3)
    assert error(result) < 1.15 * TANK_NOISE


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(1, 4))
def test_battery_has_its_resistances_and_its_capacities(seed):
    result = islands.fit(make_battery(seed))
    assert np.sort(result.linearise().poles) == pytest.approx([BATTERY_POLE, 1.0], abs=1e-4)
    discharge, relaxation = 0.9 / 9000.0 * (TIMES + 1), 0.03 * (1.0 - BATTERY_POLE**TIMES)
    assert step_response(result) == pytest.approx(-0.05 - discharge - relaxation, rel=5e-4)
    assert error(result) < 1.05 * BATTERY_NOISE
