"""Figure of residual tests: panels, band, limit and result."""

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from islands.report.figures.residuals import draw_residual_correlations
from islands.validation.residual_tests import ResidualTests, residual_tests

if TYPE_CHECKING:
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


@pytest.mark.ci
@pytest.mark.parametrize("inputs", [1, 2])
def test_correlation_tests_have_one_panel_each_with_label(inputs):
    tests = run_tests(inputs)
    figure = draw(inputs)
    assert len(figure.axes) == 1 + 4 * inputs
    assert [axes.get_title(loc="left") for axes in figure.axes] == [test.label for test in tests.tests]
    assert figure.axes[0].get_xlabel() == "lag (samples)"
