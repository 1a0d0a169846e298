"""Equilibria of models."""

import numpy as np
import pytest

import islands
from islands.errors import SettingsError
from islands.models.operating_point import find_equilibrium, parse_levels, static_characteristic
from islands.simulation.predictors import free_run


def model(**parameters):
    """A model with these parameters by term, for example ``{"y(k-1)": 0.9}``."""
    return islands.make_model((islands.parse(term), number) for term, number in parameters.items())


TANK = model(**{"y(k-1)": 0.95, "u(k-1)": 0.2, "u(k-3)": 0.1, "y(k-1)*y(k-2)": -0.02})
OUTFLOW = model(**{"y(k-1)": 1.0, "u(k-1)": 0.3, "sqrt(y(k-1))": -0.2})
SATURATION = model(**{"y(k-1)": 0.8, "tanh(u(k-1))": 0.5, "1": 0.1})
HYSTERESIS = model(
    **{"y(k-1)": 1.0, "u(k-1) - u(k-2)": 0.8, "y(k-1)*sign(u(k-1) - u(k-2))*(u(k-1) - u(k-2))": -0.1}
)


@pytest.mark.parametrize("system", [TANK, OUTFLOW, SATURATION])
def test_the_characteristic_is_the_end_of_a_long_free_run(system):
    levels = [0.3, 0.7, 1.2]
    rests = static_characteristic(system, levels)
    for level, rest in zip(levels, rests, strict=True):
        record = islands.Dataset(np.full(4000, level), np.full(4000, 1.0), 1.0)
        assert free_run(system, record).y[-1] == pytest.approx(rest, rel=1e-9)


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (HYSTERESIS, "every output is an equilibrium at u = 0.4, as in models of hysteresis"),
        (model(**{"y(k-1)": 1.0, "u(k-1)": 1.0}), "it drifts"),
        (model(**{"y(k-1)": 1.5, "u(k-1)": 1.0}), "all are unstable"),
        (model(**{"y(k-1)": 1.1, "y(k-1)^3": -0.1, "u(k-1) - u(k-2)": 1.0}), "several stable .*: -1, 1;"),
        (model(**{"y(k-1)": 0.5, "y(k-1)^2": 1e-300, "u(k-1)": 1e308}), "overflows"),
        (model(**{"y(k-1)": 1.0, "max(y(k-1), y(k-2))": 1.0, "min(y(k-1), y(k-2))": -1.0}), "every output"),
    ],
)
def test_models_without_a_unique_equilibrium_are_named(system, message):
    with pytest.raises(islands.ModelError, match=message):
        find_equilibrium(system, [0.4])


def test_a_level_is_a_name_and_a_finite_number():
    assert parse_levels(["u_V=0.5", "a=b=-1e3"], "--at") == {"u_V": 0.5, "a=b": -1000.0}
    for text in ("u_V", "=1", "u_V=", "u_V=nan", "u_V=inf"):
        with pytest.raises(SettingsError, match=r"--at .*: write NAME=VALUE"):
            parse_levels([text], "--at")
