"""Resemblance: a free curve with the shape of a simple law gets its name, and another one gets none."""

from collections.abc import Callable

import numpy as np
import pytest

from islands.diagnosis.inference.resemblance import CurveSignal, find_resemblance
from islands.kernels.curve import VALUES, interpolate

OUTPUT = CurveSignal("output", "y", "V", 2.0, is_force=False)
RATE = CurveSignal("rate", "v", "m/s", 2.0, is_force=True)

#: Values of the signal, most of which are in the middle of its range.
SIGNAL = 2.0 * np.clip(0.4 * np.random.default_rng(3).standard_normal(3000), -1.0, 1.0)

Law = Callable[[np.ndarray], np.ndarray]


def fit_curve(law: Law, is_force: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Fit a free curve, a gain and an offset to noisy values of a law; return values and half widths."""
    unit = np.eye(VALUES)
    basis = np.array([[interpolate(place, row) for row in unit] for place in SIGNAL / OUTPUT.peak])
    noise = 0.02 * np.random.default_rng(4).standard_normal(SIGNAL.size)
    design = np.column_stack([basis, SIGNAL, np.ones(SIGNAL.size)])
    found, *_ = np.linalg.lstsq(design, law(SIGNAL) + noise, rcond=None)
    deviations = 0.02 * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    # A gain of the simulation makes the slope of a map one.
    scale = 1.0 if is_force else found[VALUES]
    return found[:VALUES] / scale, 1.96 * deviations[:VALUES] / abs(scale)


@pytest.mark.parametrize(
    ("law", "name", "value", "unit"),
    [
        (lambda y: 0.9 * np.abs(y) + y, "absolute value", 0.9, ""),
        (lambda y: 3.0 * np.clip(y, -0.8, 0.8), "saturation", 0.8, "V"),
        (lambda y: 0.5 + np.sign(y) * np.maximum(np.abs(y) - 0.6, 0.0), "dead zone", 0.6, "V"),
        (lambda y: np.sign(y) * np.abs(y) ** 2.5, "power law", 2.5, ""),
    ],
)
def test_curve_with_the_shape_of_a_law_has_its_name_and_parameter(
    law: Law, name: str, value: float, unit: str
) -> None:
    found = find_resemblance(*fit_curve(law), OUTPUT)
    assert found is not None
    assert (found.law, found.unit) == (name, unit)
    assert found.value == pytest.approx(value, rel=0.15)
    assert "y" in found.formula


def test_force_resembles_a_law_next_to_any_linear_part() -> None:
    found = find_resemblance(*fit_curve(lambda v: 5.0 * v + 2.0 * np.abs(v), is_force=True), RATE)
    assert found is not None
    assert (found.law, found.formula) == ("absolute value", "|v|")


def test_curve_of_zeros_resembles_no_law() -> None:
    assert find_resemblance(np.zeros(VALUES), np.zeros(VALUES), OUTPUT) is None
