"""Themes of figures: the colours of a theme hold in its context only."""

import pytest

from islands.errors import SettingsError
from islands.report.figures.style import THEMES, blank, themed_style


@pytest.mark.parametrize("name", THEMES)
def test_a_figure_has_the_background_of_its_theme(name):
    import matplotlib
    from matplotlib.colors import to_rgb

    before = dict(matplotlib.rcParams)
    with themed_style(name) as colours:
        figure = blank(1.0)
        axes = figure.subplots()
    assert to_rgb(figure.get_facecolor()) == to_rgb(axes.get_facecolor()) == to_rgb(colours.background)
    assert dict(matplotlib.rcParams) == before


def test_an_unknown_theme_is_refused():
    with pytest.raises(SettingsError, match="theme"), themed_style("drak"):
        pass
