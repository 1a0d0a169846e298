"""Figure of holds: levels, drift and divergence."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

from islands.expressions.parsing import parse
from islands.models.narx import Model, make_model
from islands.records.dataset import Dataset
from islands.report.figures.hysteresis import draw_holds
from islands.report.figures.style import save
from islands.validation.physics import LEVELS, check_physics

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

pytestmark = pytest.mark.usefixtures("without_layout")


PERIOD = 100
ANGLE = 2 * np.pi * np.arange(5 * PERIOD) / PERIOD


@pytest.fixture(scope="module")
def record() -> Dataset:
    u = 10.0 + 20.0 * np.sin(ANGLE)
    return Dataset(u, 3.0 * np.sin(ANGLE - 0.2), 0.01, ("u_V",), "y_um", ("V",), "um")


def model(**terms: float) -> Model:
    """Return a model with parameters of y(k-1), of an increment, and of u(k-1)."""
    texts = {"y": "y(k-1)", "du": "phi1(u(k-1), u(k-2))", "u": "u(k-1)"}
    return make_model([(parse(texts[name]), value) for name, value in terms.items()], ("u_V",), "y_um", 0.01)


LEAKING = model(y=0.99, du=0.15)
BURSTING = model(y=1.01, du=0.15)


def held(axes: "Axes") -> "list[Line2D]":
    """Return the lines of the output during the hold, one per level."""
    lines = [line for line in axes.lines if len(line.get_xdata()) > 2 and line.get_xdata()[0] >= 0]
    assert len(lines) == len(LEVELS)
    return lines


def test_drift_of_a_leaking_model_equals_that_of_the_physics_check(record):
    figure = draw_holds(LEAKING, record)
    largest = check_physics(LEAKING, record).hold_drift_percent
    said = [axes.get_title(loc="left") for axes in (figure.axes[1], figure.axes[3])]
    assert largest > 10
    assert any(f"largest change {largest:.0f} % of the output range" in title for title in said)
    low, high = figure.axes[1].get_ylim()
    moved = max(np.ptp(line.get_ydata()[2:]) for line in held(figure.axes[1]))
    assert moved > 0.1 * (high - low)


@pytest.mark.parametrize("diverging", [BURSTING, model(y=1e8, du=0.15, u=1.0)])
def test_divergence_is_in_the_title_and_does_not_affect_the_axis(diverging, record, tmp_path):
    figure = draw_holds(diverging, record)
    for axes in (figure.axes[1], figure.axes[3]):
        assert axes.get_title(loc="left").endswith("5 of 5 diverged")
        assert np.abs(axes.get_ylim()).max() < 12.0
    save(figure, tmp_path / "diverged.svg")


def test_several_inputs_are_shown_as_fractions_of_their_amplitude(record):
    both = Dataset(
        np.column_stack([record.u, 2 * record.u]), record.y, 0.01, ("u_V", "T_K"), "y_um", ("V", "K"), "um"
    )
    two = make_model(
        [(parse("y(k-1)"), 1.0), (parse("phi1(u2(k-1), u2(k-2))"), 0.05)], ("u_V", "T_K"), "y_um"
    )
    left = draw_holds(two, both).axes[0]
    assert left.get_ylabel() == "inputs / amplitude"
    assert left.get_yticks() == pytest.approx(LEVELS)
