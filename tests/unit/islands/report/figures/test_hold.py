"""Figure of holds: levels, drift and divergence."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

from islands.expressions.parsing import parse
from islands.models.narx import Model, make_model
from islands.records.dataset import Dataset
from islands.report.figures.hold import draw_holds
from islands.report.figures.style import save
from islands.validation.physics import LEVELS, check_physics

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
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


STATIONARY = model(y=1.0, du=0.15)
LEAKING = model(y=0.99, du=0.15)
BURSTING = model(y=1.01, du=0.15)


@pytest.fixture(scope="module")
def stationary(record: Dataset) -> "Figure":
    """Figure of a model with a continuum of equilibria. Tests do not modify it."""
    return draw_holds(STATIONARY, record, "stationary")


@pytest.fixture(scope="module")
def bursting(record: Dataset) -> "Figure":
    return draw_holds(BURSTING, record)


def held(axes: "Axes") -> "list[Line2D]":
    """Return the lines of the output during the hold, one per level."""
    lines = [line for line in axes.lines if len(line.get_xdata()) > 2 and line.get_xdata()[0] >= 0]
    assert len(lines) == len(LEVELS)
    return lines


def test_axes_are_input_and_output_during_loading_and_unloading(stationary):
    assert len(stationary.axes) == 4
    assert [axes.get_ylabel() for axes in stationary.axes] == ["u (V)", "y (um)", "u (V)", "y (um)"]
    assert [axes.get_xlabel() for axes in stationary.axes[2:]] == 2 * ["time from the start of the hold (s)"]
    assert stationary.get_suptitle() == "stationary"


def test_input_axis_has_the_levels_in_the_unit_of_the_input(stationary):
    left = stationary.axes[0]
    assert [text.get_text() for text in left.get_yticklabels()] == ["−6", "2", "10", "18", "26"]


def test_time_is_in_seconds_from_the_start_of_the_hold(stationary):
    left, right, *_ = stationary.axes
    for line, level in zip(left.lines[:5], LEVELS, strict=True):
        time, u = line.get_data()
        assert (u[time >= 0] == level).all()
        assert u[np.flatnonzero(time < 0)[-1]] != level
    # 20 periods of 100 samples at 10 ms, two or three before.
    assert right.get_xlim()[1] == pytest.approx(20.0, rel=0.01)
    assert right.get_xlim()[0] == pytest.approx(-2.9, abs=0.1)


def test_model_with_a_continuum_of_equilibria_has_no_drift(stationary):
    for axes, words in ((stationary.axes[1], "after loading"), (stationary.axes[3], "after unloading")):
        assert axes.get_title(loc="left") == f"{words}: largest change below 0.01 % of the output range"
        for line in held(axes):
            assert np.ptp(line.get_ydata()[2:]) < 1e-9
    ends = [line.get_ydata()[-1] for line in held(stationary.axes[1])]
    assert np.diff(ends) == pytest.approx(4 * [0.15 * 8.0], rel=0.01)


def test_drift_of_a_leaking_model_equals_that_of_the_physics_check(record):
    figure = draw_holds(LEAKING, record)
    largest = check_physics(LEAKING, record).hold_drift_percent
    said = [axes.get_title(loc="left") for axes in (figure.axes[1], figure.axes[3])]
    assert largest > 10
    assert any(f"largest change {largest:.0f} % of the output range" in title for title in said)
    low, high = figure.axes[1].get_ylim()
    moved = max(np.ptp(line.get_ydata()[2:]) for line in held(figure.axes[1]))
    assert moved > 0.1 * (high - low)


def test_small_drift_has_two_decimal_places(record):
    title = draw_holds(model(y=0.99999, du=0.15), record).axes[1].get_title(loc="left")
    largest = float(title.split()[4])
    assert 0.01 < largest < 10
    assert f"{largest:.2f} %" in title


@pytest.mark.parametrize("diverging", [BURSTING, model(y=1e8, du=0.15, u=1.0)])
def test_divergence_is_in_the_title_and_does_not_affect_the_axis(diverging, record, tmp_path):
    figure = draw_holds(diverging, record)
    for axes in (figure.axes[1], figure.axes[3]):
        assert axes.get_title(loc="left").endswith("5 of 5 diverged")
        assert np.abs(axes.get_ylim()).max() < 12.0
    save(figure, tmp_path / "diverged.svg")


def test_diverged_lines_are_marked_at_their_end(bursting):
    right = bursting.axes[1]
    assert {text.get_text() for text in right.texts} == {"diverged"}
    assert len(right.texts) < 5
    marks = [line for line in right.lines if line.get_marker() == "x"]
    assert len(marks) == 5


def test_title_has_the_drift_of_the_levels_that_did_not_diverge(record, tmp_path):
    # Above 12 V in the mean the pole is outside the unit circle.
    unstable = make_model(
        [(parse("y(k-1)"), 0.88), (parse("y(k-1)*u(k-1)"), 0.01), (parse("u(k-1)"), 0.01)],
        ("u_V",),
        "y_um",
        0.01,
    )
    figure = draw_holds(unstable, record)
    for axes in (figure.axes[1], figure.axes[3]):
        assert "2 of 5 diverged,\nlargest change of the others" in axes.get_title(loc="left")
    save(figure, tmp_path / "some.svg")


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
