"""Curves through equally spaced values."""

import numpy as np
import pytest

from islands.expressions.evaluation import evaluate
from islands.expressions.parsing import parse_expression
from islands.kernels.curve import VALUES, interpolate_curve, write_curve

PLACES = np.linspace(-1.0, 1.0, VALUES + 2)


def test_curve_passes_through_its_values_and_is_zero_at_the_ends_and_outside() -> None:
    values = np.random.default_rng(1).standard_normal(VALUES)
    np.testing.assert_allclose(interpolate_curve(PLACES, values), [0.0, *values, 0.0], atol=1e-15)
    np.testing.assert_array_equal(interpolate_curve(np.array([-3.0, -1.0, 1.0, 1.5]), values), 0.0)


def test_parabola_is_reproduced() -> None:
    places = np.linspace(-1.0, 1.0, 101)
    np.testing.assert_allclose(
        interpolate_curve(places, 1.0 - PLACES[1:-1] ** 2), 1.0 - places**2, atol=1e-14
    )


@pytest.mark.parametrize("place", [-1.5, -1.0, -0.98, -0.3, 0.0, 0.41, 0.76, 1.0, 3.0])
def test_expression_has_the_values_of_the_curve(place: float) -> None:
    values = np.random.default_rng(2).standard_normal(VALUES)
    given = {"x": place, **{f"n{index}": value for index, value in enumerate(values)}}
    expected = interpolate_curve(np.array([place]), values)[0]
    assert evaluate(parse_expression(write_curve("x")), given) == pytest.approx(expected, abs=1e-12)
