"""Linear systems of several orders, and the models of a front."""

import numpy as np
import pytest

from islands.estimation.fitted_state_space import FittedStateSpace
from islands.estimation.latent_data import make_latent_data
from islands.estimation.latent_models import (
    _remove_idle_units,
    estimate_models,
    fit_linear_systems,
)
from islands.models.latent import StateSpaceLayout
from islands.progress import Steps
from islands.records.dataset import Dataset
from support.latent_systems import spring_record

#: Frequencies of the resonances, as parts of the sampling rate.
FREQUENCIES = (0.05, 0.11, 0.18, 0.26, 0.35)


def resonances_record(samples):
    """Return a record of the sum of five resonances of white noise, with noise of 0.01."""
    u, x, y = np.random.default_rng(1).standard_normal(samples), np.zeros(5, complex), np.empty(samples)
    poles = 0.98 * np.exp(2j * np.pi * np.array(FREQUENCIES))
    for k in range(samples):
        y[k] = x.real.sum()
        x = poles * x + 0.2 * u[k]
    return Dataset(u, y + 0.01 * np.random.default_rng(2).standard_normal(samples), 0.1)


def fit(record):
    return fit_linear_systems(record, make_latent_data(record), Steps())


@pytest.mark.ci
def test_a_system_with_many_resonances_has_modes():
    systems = fit(resonances_record(3000))
    found = min(systems, key=lambda each: each.fitness)
    assert found.order == 10
    assert found.fitness**0.5 == pytest.approx(0.01, rel=0.2)
    # Two states of a resonance have four entries of A, and each state has one of B and one of C.
    assert found.size <= 4 * 5 + 10 + 10 + 2
    poles = np.linalg.eigvals(found.layout.split(np.array(found.theta))["A"])
    for frequency in FREQUENCIES:
        assert np.abs(np.angle(poles) / (2 * np.pi) - frequency).min() < 1e-3


def late_record(delay):
    """Return a record of a lag behind a saturation and a dead time."""
    u, x = np.repeat(np.random.default_rng(3).uniform(-2.0, 2.0, 60), 10), 0.0
    y = np.empty(u.size)
    for k in range(u.size):
        y[k] = x
        x = 0.9 * x + 0.1 * np.tanh(u[max(k - delay, 0)])
    return Dataset(u, y + 0.01 * np.random.default_rng(4).standard_normal(u.size), 0.1)


@pytest.mark.ci
def test_systems_have_the_dead_times_of_the_linear_model_or_none():
    record = late_record(7)
    systems = fit(record)
    assert {each.delays for each in systems} == {(7,), ()}
    of_first_order = {each.delays: each for each in systems if each.order == 1}
    late, early = of_first_order[(7,)], of_first_order[()]
    assert late.fitness < 0.5 * early.fitness
    assert late.size == early.size + 1
    (model,) = estimate_models([late], record, Steps())
    assert (model.delays, model.input_names) == ((7,), record.input_names)
    assert "u(k-8)" in model.equation().plain


def make_system(**values):
    """Return a system of one state, one input and two units with the given parameters."""
    names = StateSpaceLayout(1, 1, 2).names
    theta = tuple(values.get(name, 0.0) for name in names)
    free = tuple(name in values for name in names)
    return FittedStateSpace(1, 1, ("abs", "cube"), theta, free, ((0.1,),), 1.0, 1.0)


def test_units_that_read_nothing_are_constants():
    linear = {"a1_1": 0.5, "b1": 1.0, "c1": 2.0}
    system = make_system(**linear, e1_1=3.0, f1=0.5, s1=-2.0, e1_2=0.1, w2_1=1.0, s2=0.0)
    reduced = _remove_idle_units(system)
    assert reduced.units == ("cube",)
    found = dict(zip(reduced.layout.names, reduced.theta, strict=True))
    assert (found["o1"], found["level"], found["e1_1"], found["w1_1"]) == (6.0, 1.0, 0.1, 1.0)
    assert reduced.size == system.size - 3 + 2


def test_units_that_act_on_nothing_are_removed():
    kept = {"a1_1": 0.5, "b1": 1.0, "c1": 2.0, "e1_1": 3.0, "w1_1": 1.0, "s1": 0.2}
    reduced = _remove_idle_units(make_system(**kept, w2_1=1.0, s2=0.5))
    assert (reduced.units, reduced.size) == (("abs",), 6)
    assert _remove_idle_units(reduced) is reduced


@pytest.mark.ci
def test_models_of_a_front_have_different_structures():
    record = spring_record(240, noise=0.02)
    systems = fit(record)
    models = estimate_models([systems[1], systems[1], systems[2]], record, Steps())
    assert [each.order for each in models] == [2, 3]
