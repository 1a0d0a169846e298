"""Units of the coefficients of terms."""

import pytest

from islands.diagnosis.discovery.term_unit import find_factor_unit
from islands.expressions.parsing import parse_expression

UNITS = {"x": "m", "v": "m/s", "u": "N", "w": "N s/m", "t": "s", "p": "1", "unknown": "", "q": "m/(s K)"}


@pytest.mark.parametrize(
    ("expression", "unit"),
    [
        ("x", "1/s^2"),
        ("v", "1/s"),
        ("abs(x)*sign(v)", "1/s^2"),
        ("x**2*v", "1/m^2/s"),
        ("sqrt(abs(x))*sign(x)", "m^0.5/s^2"),
        ("max(x, 0)", "1/s^2"),
        ("t*x", "1/s^3"),
        ("rate(u)", "m/s/N"),
        ("abs(rate(u))*x", "1/s/N"),
        ("u*w", "m^2/s^3/N^2"),
        ("x/v", "m/s^3"),
        ("sign(u)", "m/s^2"),
        ("p**3", "m/s^2"),
        ("x + 0.1", "1/s^2"),
        ("x + v", ""),
        ("unknown*x", ""),
        ("q", ""),
        ("delay(u, 0.1)", ""),
    ],
)
def test_unit_of_a_coefficient_completes_that_of_the_equation(expression: str, unit: str) -> None:
    assert find_factor_unit("m/s^2", parse_expression(expression), UNITS) == unit
