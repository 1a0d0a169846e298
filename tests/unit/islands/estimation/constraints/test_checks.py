"""Verification of constraints."""

import math

import pytest

import islands
from islands.estimation.constraints.checks import check_constraints


def check(text, terms):
    model = islands.make_model([(islands.parse(name), theta) for name, theta in terms.items()])
    (found,) = check_constraints(model, text)
    assert found.text == text
    return found.target, found.value, found.met


LINEAR = {"y(k-1)": 0.8, "u(k-1)": 0.3, "u(k-2)": 0.2}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("gain = 2.5", (2.5, pytest.approx(2.5), True)),
        ("gain = 2.4", (2.4, pytest.approx(2.5), False)),
        ("fixed-point = 2, 5", (5.0, pytest.approx(5.0), True)),
        ("fixed-point = 2, 4", (4.0, pytest.approx(4.2), False)),
        ("[u(k-1)] - [u(k-2)] = 0.1", (0.1, pytest.approx(0.1), True)),
        ("[u(k-7)] = 0.1", (0.1, 0.0, False)),
        ("[u(k-1)] >= 0", (0.0, 0.3, True)),
        ("[u(k-1)] <= 0", (0.0, 0.3, False)),
        ("[u(k-7)] <= 0", (0.0, 0.0, True)),
        ("odd", (0.0, 0.0, True)),
        ("even", (0.0, 2.0, False)),
        ("hysteresis", (0.0, 0.5, False)),
    ],
)
def test_check_has_target_and_value(text, expected):
    assert check(text, LINEAR) == expected


@pytest.mark.parametrize(("change", "met"), [(0.0, True), (1e-12, True), (1e-8, False)])
def test_equality_is_met_to_nine_digits(change, met):
    assert check("fixed-point = 2, 5", {**LINEAR, "u(k-1)": 0.3 + change})[2] is met


def test_gain_of_an_integrator_is_not_defined():
    """y(k) = y(k-1) satisfies the linear equality of every gain."""
    _, value, met = check("gain = 2.5", {"y(k-1)": 1.0})
    assert math.isnan(value)
    assert not met
