"""Dry friction of a model of a velocity: terms in the sign of the output that oppose the motion."""

from typing import Any

import pytest

from islands.report.text.dry_friction import DryFriction, find_dry_friction

MOTOR = (("y(k-1)", 0.95), ("u(k-1)", 0.8), ("sign(y(k-1))", -0.9))


def make_terms(*terms: tuple[str, float], error: float | None = 0.001) -> list[dict[str, Any]]:
    return [{"regressor": text, "parameter": value, "standard_error": error} for text, value in terms]


def test_friction_is_the_opposing_step_and_the_input_that_balances_it():
    assert find_dry_friction(make_terms(*MOTOR), "rad/s") == DryFriction(0.9, pytest.approx(1.125))


def test_lags_of_one_direction_add_up():
    driving, opposing = (("u(k-1)", 0.5), ("u(k-2)", 0.3)), (("sign(y(k-1))", -0.7), ("sign(y(k-2))", -0.2))
    split = make_terms(MOTOR[0], *driving, *opposing)
    assert find_dry_friction(split, "m/s") == pytest.approx(DryFriction(0.9, 1.125))


@pytest.mark.parametrize("unit", ["rpm", "m/s", "deg/s", "1/min"])
def test_the_output_is_a_velocity(unit):
    assert find_dry_friction(make_terms(*MOTOR), unit)


@pytest.mark.parametrize("unit", ["", "um", "m/s^2", "l/min", "kg/s", "s"])
def test_a_sign_of_another_quantity_is_no_friction(unit):
    assert find_dry_friction(make_terms(*MOTOR), unit) is None


@pytest.mark.parametrize(
    "terms",
    [
        make_terms(*MOTOR[:2]),
        make_terms(*MOTOR[:2], ("sign(y(k-1))", 0.9)),
        make_terms(*MOTOR[:2], ("u(k-1)*sign(y(k-1))", -0.9)),
        make_terms(*MOTOR[:2], ("sign(y(k-1) - y(k-2))", -0.9)),
        make_terms(*MOTOR, error=0.5),
    ],
    ids=["none", "driving", "product", "acceleration", "uncertain"],
)
def test_terms_that_do_not_oppose_the_motion_are_no_friction(terms):
    assert find_dry_friction(terms, "rad/s") is None


@pytest.mark.parametrize("other", [("u(k-1)^2", 0.1), ("y(k-1)*u(k-1)", 0.1)])
def test_an_input_that_acts_nonlinearly_has_no_balance(other):
    assert find_dry_friction(make_terms(*MOTOR, other), "rad/s") == DryFriction(0.9, None)


def test_several_inputs_have_no_balance():
    terms = make_terms(MOTOR[0], ("u1(k-1)", 0.8), ("u2(k-1)", 0.1), MOTOR[2], error=None)
    assert find_dry_friction(terms, "rad/s") == DryFriction(0.9, None)
