"""Figure of residual tests: panels, band, limit and result."""

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from islands.report.figures.residuals import draw_residual_correlations
from islands.report.figures.style import save
from islands.validation.residual_tests import ResidualTests, residual_tests

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

pytestmark = pytest.mark.usefixtures("without_layout")


SAMPLES = 1000


@cache
def run_tests(inputs: int = 1, coloured: bool = False) -> ResidualTests:
    rng = np.random.default_rng(4)
    white = rng.standard_normal(SAMPLES)
    residual = white[1:] + 0.9 * white[:-1] if coloured else white[1:]
    return residual_tests(residual, rng.standard_normal((SAMPLES - 1, inputs)), 20)


@cache
def draw(inputs: int = 1, coloured: bool = False, title: str = "") -> "Figure":
    return draw_residual_correlations(run_tests(inputs, coloured), title)


def stems(axes: "Axes") -> np.ndarray:
    """Return (lag, value) of every stem."""
    (collection,) = axes.collections
    return np.array([segment[1] for segment in collection.get_segments()])


@pytest.mark.ci
@pytest.mark.parametrize("inputs", [1, 2])
def test_correlation_tests_have_one_panel_each_with_label(inputs):
    tests = run_tests(inputs)
    figure = draw(inputs)
    assert len(figure.axes) == 1 + 4 * inputs
    assert [axes.get_title(loc="left") for axes in figure.axes] == [test.label for test in tests.tests]
    assert figure.axes[0].get_xlabel() == "lag (samples)"


def test_panels_show_values_band_and_limit():
    tests = run_tests()
    for axes, test in zip(draw().axes, tests.tests, strict=True):
        np.testing.assert_array_equal(stems(axes), np.column_stack([test.lags, test.values]))
        (band,) = axes.patches
        assert (band.get_y(), band.get_height()) == pytest.approx((-test.band, 2 * test.band))
        dashed = [line.get_ydata()[0] for line in axes.lines if line.get_linestyle() == "--"]
        assert dashed == [test.limit, -test.limit]


def test_limits_and_tested_values_are_inside_the_panel():
    for coloured in (False, True):
        tests = run_tests(coloured=coloured)
        for axes, test in zip(draw(coloured=coloured).axes, tests.tests, strict=True):
            counted = test.values[1:] if test.input is None else test.values
            assert axes.get_ylim()[1] > max(test.limit, np.abs(counted).max())


def test_lag_0_of_the_autocorrelation_does_not_affect_the_scale():
    assert draw().axes[0].get_ylim()[1] < 0.2


def test_title_announces_that_a_white_residual_passes():
    figure = draw(title="model 12")
    title, verdict = figure.get_suptitle().split("\n")
    assert title == "model 12"
    assert verdict.startswith("residual tests passed: 5 of 5 correlations passed, whiteness p = 0.")
    assert [axes.get_title(loc="right") for axes in figure.axes] == 5 * ["passed"]


def test_title_has_the_p_value_of_the_whiteness_test():
    tests = run_tests()
    assert f"whiteness p = {tests.whiteness_p:.2g}" in draw().get_suptitle()


def test_title_announces_that_a_coloured_residual_fails():
    figure = draw(coloured=True)
    assert figure.get_suptitle() == ("residual tests failed: 4 of 5 correlations passed, whiteness p < 0.001")
    assert [axes.get_title(loc="right") for axes in figure.axes] == ["FAILED", *4 * ["passed"]]


def test_legend_explains_band_and_limit():
    (legend,) = draw().legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "95 % band of a single lag",
        "limit of the test",
        "correlation",
    ]


def test_constant_input_is_noted_in_its_panels(tmp_path):
    residual = np.random.default_rng(0).standard_normal(300)
    figure = draw_residual_correlations(residual_tests(residual, np.ones((300, 1))))
    notes = [" ".join(text.get_text().split()) for axes in figure.axes for text in axes.texts]
    assert len(notes) == 4
    assert notes[0] == "input 1 is constant: there is nothing to correlate"
    save(figure, tmp_path / "noted.svg")
