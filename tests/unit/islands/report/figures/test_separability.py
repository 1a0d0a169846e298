"""Matrix of separable causes: every name is inside the figure, and cells show what is separable."""

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from islands.diagnosis.planning.isolability import DetectableStrength, Isolability, IsolabilityRow
from islands.effects.catalogue import CATALOGUE
from islands.report.figures.separability import draw_separability

WEAKEST = DetectableStrength(0.1, 0.01, 1.0, "V")


def make_isolability(longest: str) -> Isolability:
    """Return a cause that needs a larger strength, one that is never separable, and an undetectable one."""
    offset = CATALOGUE["offset"]
    effects = (offset, replace(offset, name="jump"), replace(offset, name=longest))
    rows = (
        IsolabilityRow(WEAKEST, None, (nan, 2.5, 0.1), (nan, nan, nan)),
        IsolabilityRow(WEAKEST, None, (inf, nan, 0.1), (nan, nan, nan)),
        IsolabilityRow(None, None, (nan, nan, nan), (nan, nan, nan)),
    )
    return Isolability(effects, rows)


@pytest.mark.parametrize("longest", ["delay", "wrong-parameter:time_constant"])
def test_every_name_is_inside_the_figure(longest: str) -> None:
    figure = draw_separability(make_isolability(longest))
    figure.draw_without_rendering()
    for label in (*figure.axes[0].get_xticklabels(), *figure.axes[0].get_yticklabels()):
        box = label.get_window_extent()
        assert box.x0 >= 0
        assert box.x1 <= figure.bbox.width
        assert box.y1 <= figure.bbox.height


def test_cells_have_the_strength_where_it_exceeds_that_of_detection() -> None:
    axes = draw_separability(make_isolability("delay"), "a title").axes[0]
    assert [text.get_text() for text in axes.texts] == ["2.5"]
    mesh = axes.collections[0]
    shown = np.ma.filled(mesh.get_array().reshape(3, 3), np.nan)
    assert shown[0, 2] == pytest.approx(0.1)
    assert shown[1, 0] > 10.0
    assert np.isnan(shown[2]).all()
