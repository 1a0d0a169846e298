"""Fits of processes with slow modes, which measurement noise hides from the one-step-ahead error."""

import numpy as np
import pytest

import islands
from support.slow_processes import BATTERY_POLE, TANK_NOISE, make_battery, make_tank


def error(result):
    return result.best.metrics["validation"]["free_run"].rmse


@pytest.mark.ci
@pytest.mark.parametrize("library", [pytest.param("auto", marks=pytest.mark.nightly), "polynomial"])
def test_level_of_a_tank_has_the_two_terms_of_its_law(library):
    result = islands.fit(make_tank(1, 600), library=library)
    assert result.best.model.parameter_names == ("y(k-1)", "u1(k-1)")
    assert result.best.model.theta == pytest.approx((1.0, 0.02), abs=3e-4)
    assert error(result) < 1.15 * TANK_NOISE


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(1, 4))
def test_free_run_of_a_battery_has_the_error_of_the_noise(seed):
    result = islands.fit(make_battery(seed))
    assert error(result) < 0.0006
    model = result.best.model
    assert model.size == 5
    assert np.sort(np.roots([1.0, *(-value for value in model.theta[:2])])) == pytest.approx(
        [BATTERY_POLE, 1.0], abs=1e-3
    )
