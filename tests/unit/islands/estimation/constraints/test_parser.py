"""Text of constraints."""

import time

import pytest

from islands.errors import SettingsError
from islands.estimation.constraints.parser import FORMS
from islands.estimation.constraints.parts import (
    LinearEquality,
)
from islands.estimation.parameter_constraints import constraint
from islands.expressions.parsing import parse
from islands.models.regressor import regressor


def term(text):
    return regressor(parse(text))[1]


def part(text):
    (found,) = constraint(text).parts
    return found


@pytest.mark.parametrize(
    ("text", "weights", "target"),
    [
        ("[u(k-1)] = 0.5", {"u(k-1)": 1.0}, 0.5),
        (
            "2*[u(k-1)] - [u(k-2)]+1e-1 * [phi2(u(k-1), u(k-2))] = -1",
            {"u(k-1)": 2.0, "u(k-2)": -1.0, "phi2(u(k-1), u(k-2))": 0.1},
            -1.0,
        ),
        # The parameter of 4*u(k-1) is a quarter of the parameter of u(k-1).
        ("[4*u(k-1)] = 1", {"u(k-1)": 0.25}, 1.0),
        ("[u(k-1)*y(k-1)] + [y(k-1)*u(k-1)] = 1", {"y(k-1)*u(k-1)": 2.0}, 1.0),
    ],
)
def test_equality_has_a_weight_for_every_term(text, weights, target):
    found = part(text)
    assert isinstance(found, LinearEquality)
    assert found.weights == {term(name): weight for name, weight in weights.items()}
    assert found.target == target


@pytest.mark.parametrize(
    "text",
    [
        "[u(k-1)] " * 2000,
        "[u(k-1)]" + " " * 19_000 + "x",
        "1" * 19_000 + "[u(k-1)] = 1",
        f"[{'abs(' * 300}u(k-1){')' * 300}] = 0",
        f"gain(u{'1' * 5000}) = 1",
    ],
    ids=["terms", "spaces", "digits", "depth", "channel"],
)
def test_long_text_is_refused_at_once(text):
    """A service reads statements of clients: the time must not grow faster than the length."""
    began = time.perf_counter()
    with pytest.raises(SettingsError):
        constraint(text)
    assert time.perf_counter() - began < 5.0


def test_forms_can_be_read():
    for form in FORMS:
        text = form
        for name, number in {"U1": "1", "U2": "2", "U": "1", "Y": "3", "G": "4"}.items():
            text = text.replace(f" {name}", f" {number}")
        assert constraint(text).parts


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("physics", "unknown constraints 'physics': take one of none, hysteresis, odd, even, or a statement"),
        ("odd;", "unknown constraints ''"),
        ("gain = big", "unknown constraints 'gain = big'"),
        ("[u(k-1)] = x", "unknown constraints"),
        ("[u(k-1)] [u(k-2)] = 1", r"lacks a sign before \[u\(k-2\)\]"),
        ("[u(k-1)] - [u(k-1)] = 0", "the terms of .* cancel"),
        ("[u(k-1)] >= 1", "not the sign of one parameter"),
        ("[u(k-1)] + [u(k-2)] >= 0", "not the sign of one parameter"),
        ("[sigmoid(u(k-1))] = 0", "unknown function 'sigmoid'"),
        ("[u(k)] = 0", "reads only past samples"),
        ("[u(k-1) - u(k-1)] = 0", "identically zero"),
        ("fixed-point = 1", "has one number"),
        ("gain = 1e999", "too large"),
        ("gain(u2) = 1 at 1, 2", "an input without a value"),
        ("gain(u0) = 1", "an input without a value"),
        ("hysteresis; gain = 1", "no static gain"),
        ("; ".join(["odd"] * 51), "51 constraints are too many"),
    ],
)
def test_unreadable_statement_raises_settings_error(text, message):
    with pytest.raises(SettingsError, match=message):
        constraint(text)
