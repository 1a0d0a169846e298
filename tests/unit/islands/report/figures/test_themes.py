"""Themes of figures: the colours of a theme hold in its context only."""

import pytest

from islands.errors import SettingsError
from islands.report.figures.style import blank
from islands.report.figures.themes import THEMES, themed_style


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


@pytest.mark.parametrize("name", THEMES)
def test_text_and_lines_are_readable_on_the_background(name):
    from matplotlib.colors import to_rgb

    def luminance(colour: str) -> float:
        linear = [
            part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in to_rgb(colour)
        ]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    theme = THEMES[name]
    for colour, least in ((theme.text, 7.0), (theme.output, 3.0), (theme.mark, 3.0), (theme.inputs[0], 3.0)):
        low, high = sorted((luminance(colour), luminance(theme.background)))
        assert (high + 0.05) / (low + 0.05) >= least, colour


def test_an_unknown_theme_is_refused():
    with pytest.raises(SettingsError, match="theme"), themed_style("drak"):
        pass
