"""Equilibria and linearisations of models."""

import numpy as np
import pytest

import islands
from islands.models.operating_point import differentiate_model, find_equilibrium, static_characteristic
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


@pytest.mark.parametrize("system", [TANK, OUTFLOW, SATURATION])
def test_the_error_of_the_linearisation_is_of_second_order(system):
    level = 0.7
    linear = differentiate_model(system, level)
    rng = np.random.default_rng(0)
    wave, lags = rng.normal(size=200), len(linear.outputs)

    def difference(size):
        u = level + size * wave
        y = np.full(200, linear.y)
        simulated = free_run(system, islands.Dataset(u, y, 1.0)).y
        for k in range(lags, 200):
            past = np.arange(k - 1, k - lags - 1, -1)
            y[k] += linear.outputs @ (y[past] - linear.y) + linear.inputs[0, 1:] @ (u[past] - level)
        return np.nanmax(np.abs(simulated - y))

    assert difference(1e-3) / difference(1e-4) == pytest.approx(100.0, rel=0.1)
    assert difference(1e-3) < 1e-4


def test_a_kink_has_no_linearisation():
    with pytest.raises(islands.ModelError, match=r"the term y\(k-1\)\*sign\(.* has a kink"):
        differentiate_model(HYSTERESIS, 0.4, y=1.0)
    with pytest.raises(islands.ModelError, match=r"the model has 1 inputs \(u\), got"):
        differentiate_model(TANK, [0.4, 0.5])
