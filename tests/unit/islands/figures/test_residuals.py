"""The residual tests' figure: a panel for each test, its band and limit, and the verdict in words."""

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from islands.figures.residuals import draw_residual_correlations
from islands.figures.style import save
from islands.validation.residual_tests import ResidualTests, residual_tests

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

pytestmark = pytest.mark.usefixtures("without_layout")


SAMPLES = 1000


@cache
def found(inputs: int = 1, coloured: bool = False) -> ResidualTests:
    rng = np.random.default_rng(4)
    white = rng.standard_normal(SAMPLES)
    residual = white[1:] + 0.9 * white[:-1] if coloured else white[1:]
    return residual_tests(residual, rng.standard_normal((SAMPLES - 1, inputs)), 20)


@cache
def drawn(inputs: int = 1, coloured: bool = False, title: str = "") -> "Figure":
    return draw_residual_correlations(found(inputs, coloured), title)


def stems(axes: "Axes") -> np.ndarray:
    """Return (lag, value) of every stem."""
    (collection,) = axes.collections
    return np.array([segment[1] for segment in collection.get_segments()])


@pytest.mark.parametrize("inputs", [1, 2])
def test_every_test_has_a_panel_with_its_label(inputs):
    tests = found(inputs)
    figure = drawn(inputs)
    assert len(figure.axes) == 1 + 4 * inputs
    assert [axes.get_title(loc="left") for axes in figure.axes] == [test.label for test in tests.tests]
    assert figure.axes[0].get_xlabel() == "lag (samples)"


def test_a_panel_shows_values_band_and_limit():
    tests = found()
    for axes, test in zip(drawn().axes, tests.tests, strict=True):
        np.testing.assert_array_equal(stems(axes), np.column_stack([test.lags, test.values]))
        (band,) = axes.patches
        assert (band.get_y(), band.get_height()) == pytest.approx((-test.band, 2 * test.band))
        dashed = [line.get_ydata()[0] for line in axes.lines if line.get_linestyle() == "--"]
        assert dashed == [test.limit, -test.limit]


def test_limits_and_values_that_count_lie_inside_the_panel():
    for coloured in (False, True):
        tests = found(coloured=coloured)
        for axes, test in zip(drawn(coloured=coloured).axes, tests.tests, strict=True):
            counted = test.values[1:] if test.input is None else test.values
            assert axes.get_ylim()[1] > max(test.limit, np.abs(counted).max())


def test_lag_0_of_the_residual_itself_does_not_flatten_the_rest():
    assert drawn().axes[0].get_ylim()[1] < 0.2


def test_a_white_residual_is_said_to_pass():
    figure = drawn(title="model 12")
    title, verdict = figure.get_suptitle().split("\n")
    assert title == "model 12"
    assert verdict.startswith("residual tests passed: 5 of 5 correlations passed, whiteness p = 0.")
    assert [axes.get_title(loc="right") for axes in figure.axes] == 5 * ["passed"]


def test_the_whiteness_is_the_tests_own():
    tests = found()
    assert f"whiteness p = {tests.whiteness_p:.2g}" in drawn().get_suptitle()


def test_a_coloured_residual_is_said_to_fail():
    figure = drawn(coloured=True)
    assert figure.get_suptitle() == ("residual tests failed: 4 of 5 correlations passed, whiteness p < 0.001")
    assert [axes.get_title(loc="right") for axes in figure.axes] == ["FAILED", *4 * ["passed"]]


def test_the_legend_explains_band_and_limit():
    (legend,) = drawn().legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "95 % band of a single lag",
        "limit that decides",
        "correlation",
    ]


def test_a_constant_input_is_noted_in_its_panels(tmp_path):
    residual = np.random.default_rng(0).standard_normal(300)
    figure = draw_residual_correlations(residual_tests(residual, np.ones((300, 1))))
    notes = [" ".join(text.get_text().split()) for axes in figure.axes for text in axes.texts]
    assert len(notes) == 4
    assert notes[0] == "input 0 is constant: there is nothing to correlate"
    save(figure, tmp_path / "noted.svg")
