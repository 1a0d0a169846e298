"""Statements about latent models, and their conditions on the parameters."""

from dataclasses import replace

import numpy as np
import pytest

from islands.errors import SettingsError
from islands.estimation.constraints.checks import check_constraints
from islands.estimation.constraints.state_space import (
    find_conditions,
    linearise_constraints,
    meet_constraints,
    take_system,
)
from islands.estimation.parameter_constraints import check_latent_constraints
from islands.records.flat_extremes import SensorLimits
from islands.simulation.predictors import free_run
from support.latent_systems import SPRING, make_model, spring_record

#: Statements that the model of the spring does not meet.
STATEMENTS = (
    "gain = 0.5",
    "gain = 0.4 at 1, 0.7",
    "fixed-point = 0, 0",
    "fixed-point = 1, 0.8; gain = 0.4 at 1, 0.8",
    "gain = 0",
)

#: An odd model.
ODD = {name: value for name, value in SPRING.items() if name != "level"}


def polish(model, text):
    theta = find_conditions(text, model.inputs).polish(take_system(model))
    return model.with_parameters(theta[np.isin(model.layout.names, model.wiring)].tolist())


@pytest.mark.parametrize("text", STATEMENTS)
def test_conditions_hold_to_nine_digits_after_corrections(text):
    model = make_model()
    assert not all(each.met for each in check_constraints(model, text))
    for check in check_constraints(polish(model, text), text):
        assert check.met
        assert check.value == pytest.approx(check.target, rel=1e-9, abs=1e-9)


def test_the_gain_is_the_slope_of_simulated_outputs_at_rest():
    model = polish(make_model(), "gain = 0.4 at 1, 0.7")
    outputs = []
    for u in (0.999, 1.001):
        record = spring_record(600)
        outputs.append(free_run(model, replace(record, u=np.full((600, 1), u)), 20).y[-1])
    assert (outputs[1] - outputs[0]) / 0.002 == pytest.approx(0.4, rel=1e-4)


def test_conditions_of_scaled_signals_are_those_of_the_signals():
    model, mean, deviation = make_model(), np.array([2.0]), np.array([3.0])
    conditions = find_conditions("fixed-point = 1, 0.8; gain = 0.4 at 1, 0.8", 1)
    scaled = conditions.scale(mean, deviation, 0.5, 4.0)
    assert [each.target for each in scaled.statics] == pytest.approx([0.3 / 4.0, 0.4 * 3.0 / 4.0])
    assert scaled.statics[0].inputs == pytest.approx([-1.0 / 3.0])
    assert conditions.evaluate(take_system(model)).measure() > 0.1


def test_contradictory_statements_cannot_be_met():
    linear = make_model({"a1_1": 0.9, "b1": 0.1, "c1": 1.0}, (), 1)
    text = "gain = 1 at 0, 0; gain = 2 at 1, 1"
    conditions, free = find_conditions(text, 1), linear.theta != 0.0
    assert conditions.correct(take_system(linear), free, lambda columns: columns) is None
    assert polish(linear, text) == linear
    assert not all(each.met for each in check_constraints(linear, text))


def test_an_odd_model_rests_at_zero_without_a_condition():
    model = make_model(ODD)
    assert all(each.met for each in check_constraints(model, "odd; fixed-point = 0, 0"))
    assert not len(linearise_constraints(model, "odd; fixed-point = 0, 0").c)


@pytest.mark.parametrize(
    ("changes", "others"),
    [
        ({}, 0),
        ({"level": 0.1, "s1": 0.2, "o1": 0.3}, 3),
        ({"units": ("square",)}, 1),
        ({"limits": SensorLimits(-1.0, None)}, 1),
        ({"limits": SensorLimits(-1.0, 1.0)}, 0),
    ],
)
def test_an_odd_model_has_odd_units_without_offsets(changes, others):
    names = make_model().layout.names
    added = {name: value for name, value in changes.items() if name in names}
    values = {**ODD, **added}
    fields = {name: value for name, value in changes.items() if name not in names}
    model = make_model({name: values[name] for name in names if name in values}, **fields)
    (check,) = check_constraints(model, "odd")
    assert (check.value, check.met) == (others, not others)


def test_a_model_without_rest_has_no_gain():
    model = make_model({"a1_1": 1.0, "b1": 1.0, "c1": 1.0}, (), 1)
    (check,) = check_constraints(model, "gain = 1 at 1, 1")
    assert np.isnan(check.value)
    assert not check.met


def test_draws_meet_the_constraints():
    text = "gain = 0.5"
    model = polish(make_model(), text)
    drawn = np.array(model.parameters) * (
        1.0 + 0.02 * np.random.default_rng(0).standard_normal((5, model.size))
    )
    met = meet_constraints(model, drawn, text)
    assert met.shape == drawn.shape
    for each in met:
        assert check_constraints(model.with_parameters(each.tolist()), text)[0].met
    assert meet_constraints(model, drawn, "none") is drawn


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hysteresis", "needs a pole of exactly 1 that no input moves; take the preset hysteresis"),
        ("even", "its states read the inputs linearly"),
        ("[u(k-1)] = 0.5", "the parameters of a state space are not unique"),
        ("gain = 2; [u(k-1)] >= 0", r"Statements about latent models are gain, fixed-point and odd"),
    ],
)
def test_statements_that_make_no_sense_for_a_state_space_are_refused(text, message):
    with pytest.raises(SettingsError, match=message):
        check_latent_constraints(text)
    with pytest.raises(SettingsError, match=message):
        check_constraints(make_model(), text)
