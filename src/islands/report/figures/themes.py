"""Themes of figures that a page shows in the colours of the reader's system."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from matplotlib import rc_context

from islands.errors import lookup
from islands.report.figures.style import house_style


@dataclass(frozen=True, slots=True)
class Theme:
    """Colours of a figure.

    Attributes
    ----------
    background, text, grid, frame : str
    inputs : tuple of str
        Colours of the inputs.
    output : str
        Colour of the measured output.
    mark : str
        Colour of simulations and of marks.
    """

    background: str
    text: str
    grid: str
    frame: str
    inputs: tuple[str, ...]
    output: str
    mark: str


#: Colours by the name of the theme.
THEMES = MappingProxyType(
    {
        "light": Theme(
            *("#ffffff", "#222222", "#ececec", "#5a5a5a"),
            ("#0072b2", "#009e73", "#8c6bb1"),
            "#3a3a3a",
            "#d55e00",
        ),
        "dark": Theme(
            *("#16181d", "#dcdfe4", "#2c3038", "#8a909b"),
            ("#56b4e9", "#4fc39a", "#b9a3e3"),
            "#e6e6e6",
            "#f0935a",
        ),
    }
)


@contextmanager
def themed_style(name: str) -> Iterator[Theme]:
    """Apply the style of figures with the colours of a theme, and restore the settings afterwards.

    Raises
    ------
    SettingsError
        The theme is unknown.
    """
    colours = lookup(THEMES, name, "theme")
    settings: dict[Any, Any] = {
        "axes.edgecolor": colours.frame,
        "axes.facecolor": colours.background,
        "axes.labelcolor": colours.text,
        "axes.titlecolor": colours.text,
        "figure.facecolor": colours.background,
        "grid.color": colours.grid,
        "savefig.facecolor": colours.background,
        "text.color": colours.text,
        "xtick.color": colours.frame,
        "xtick.labelcolor": colours.text,
        "ytick.color": colours.frame,
        "ytick.labelcolor": colours.text,
    }
    with house_style(), rc_context(settings):
        yield colours
