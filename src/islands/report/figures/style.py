"""Style and themes of figures, and writing of SVG files.

Equal content gives equal bytes: the matplotlibrc of the user is ignored, and files have no date and no random
identifiers.
"""

from base64 import b64encode
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from textwrap import fill
from types import MappingProxyType
from typing import IO, Any

import matplotlib
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogFormatter

from islands.errors import lookup

#: Width of figures in inches (text column of an article). Font sizes below are points at this width.
WIDTH = 7.0

#: Colour of measured data. It and the next two are distinguishable for colour-blind readers and in grey print
#: (Okabe & Ito, 2008).
MEASURED = "#3a3a3a"

#: Colour of simulations.
SIMULATED = "#d55e00"

#: Colour of prediction bands, a light tint of that of simulations.
BAND = "#f7d4b5"

#: Colour of residuals.
RESIDUAL = "#0072b2"

#: Colour of boundaries and frames.
FRAME = "#8c8c8c"

#: Colour of shaded areas.
SHADE = "#ebebeb"

#: Width of measured lines in points. They lie under thinner simulated lines, so that both are visible.
MEASURED_WIDTH = 2.2

#: Width of simulated lines in points.
SIMULATED_WIDTH = 0.8

#: Font size of annotations in points.
REMARK = 7.5

#: Tick steps of low panels, times powers of ten.
STEPS = (1, 2, 2.5, 5, 10)

#: Style of an image in HTML: a figure is drawn on white, also in a dark notebook.
_IMAGE = "max-width: 100%; background: white"

#: Characters per line of a title.
_TITLE_CHARACTERS = 80

_STYLE = {
    "axes.axisbelow": True,
    "axes.edgecolor": "#5a5a5a",
    "axes.grid": True,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 8.5,
    "figure.constrained_layout.use": True,
    "figure.titlesize": 10.0,
    "font.family": ["DejaVu Sans"],  # the font that matplotlib includes
    "font.size": 8.5,
    "grid.color": "#dadada",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
    "lines.solid_joinstyle": "round",  # a mitred peak extends beyond its sample
    "svg.fonttype": "path",  # independent of installed fonts
    "svg.hashsalt": "islands",
    "text.parse_math": False,  # a $ or _ in a column name is not mathematics
    "xtick.labelsize": 8.0,
    "xtick.major.width": 0.7,
    "ytick.labelsize": 8.0,
    "ytick.major.width": 0.7,
}


@contextmanager
def house_style() -> Iterator[None]:
    """Apply the style of figures, as a decorator or context manager, and restore the settings afterwards."""
    settings: dict[Any, Any] = {**matplotlib.rcParamsDefault, **_STYLE}
    settings.pop("backend", None)
    with matplotlib.rc_context(settings):
        yield


class ShownFigure(Figure):
    """Figure that a notebook shows, also if nothing has imported pyplot."""

    def _repr_html_(self) -> str:
        return image_html(self, "figure")


def image_html(figure: Figure, alternative: str) -> str:
    """Return a figure as an image in HTML, with an alternative text.

    An image keeps the identifiers of the figure's shapes apart from those of other figures in the notebook.
    """
    stream = BytesIO()
    save(figure, stream)
    image = b64encode(stream.getvalue()).decode("ascii")
    return f'<img src="data:image/svg+xml;base64,{image}" alt="{escape(alternative)}" style="{_IMAGE}">'


def blank(height: float, title: str = "") -> Figure:
    """Return an empty figure of width `WIDTH` and a height in inches, with a left-aligned title."""
    figure = ShownFigure(figsize=(WIDTH, height))
    if title:
        lines = (fill(line, _TITLE_CHARACTERS) for line in title.splitlines())
        figure.suptitle("\n".join(lines), x=0.01, ha="left")
    return figure


def finish(figure: Figure) -> Figure:
    """Lay out a figure and freeze the layout, because each new layout moves parts slightly."""
    engine = figure.get_layout_engine()
    # A figure without axes has no layout.
    if engine is not None and figure.axes:
        engine.execute(figure)
    figure.set_layout_engine("none")
    return figure


def label(name: str, unit: str) -> str:
    """Return the axis label of a column: ``y (um)`` for ``y_um`` or ``y [um]`` with the unit um."""
    if not unit:
        return name
    for suffix in (f"_{unit}", f"[{unit}]", f"({unit})"):
        if name.endswith(suffix):
            name = name.removesuffix(suffix).rstrip()
            break
    return f"{name} ({unit})".lstrip()


def save(figure: Figure, path: str | Path | IO[bytes]) -> None:
    """Write a figure as SVG; equal content gives equal bytes.

    Parameters
    ----------
    figure : Figure
        Figure made by a function of this package.
    path : str, Path or stream
        File in an existing folder, or binary stream.
    """
    canvas = figure.canvas
    try:
        with house_style():
            # `Figure.savefig` draws twice, since it does not know that the layout is done.
            drawing: Any = FigureCanvasSVG(figure)
            drawing.print_svg(path, metadata={"Date": None, "Creator": "islands"})
    finally:
        figure.set_canvas(canvas)


def write_text_figure(text: str) -> bytes:
    """Return an SVG with a text in place of a figure that cannot be drawn."""
    lines = fill(text, _TITLE_CHARACTERS).splitlines()
    height = 20 * (len(lines) + 1)
    rows = "".join(f'<text x="10" y="{20 * at}">{escape(line)}</text>' for at, line in enumerate(lines, 1))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 720 {height}" font-family="sans-serif" '
        f'font-size="14"><rect width="100%" height="100%" fill="white"/>{rows}</svg>\n'
    ).encode()


def set_log_scale(axes: Axes) -> None:
    """Set a logarithmic axis of errors, upwards, with plain numbers."""
    axes.set_yscale("log")
    write_plain_numbers(axes.yaxis)


def write_plain_numbers(axis: Axis) -> None:
    """Write the numbers of a logarithmic axis without powers, which the style does not typeset."""
    axis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
    # A range within one decade may contain no power of ten, so label minor ticks, too.
    axis.set_minor_formatter(_PlainLogFormatter(minor_thresholds=(1.0, 0.5)))


class _PlainLogFormatter(LogFormatter):
    """Labels the same ticks as `LogFormatter`, with plain numbers."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return f"{x:g}" if super().__call__(x, pos) else ""


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
