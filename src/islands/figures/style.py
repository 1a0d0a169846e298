"""The house style of figures, and how one is written to a file.

The same content gives the same bytes: whatever a user's matplotlibrc says is left aside, and the file holds
no date and no identifier made by chance.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from textwrap import fill
from typing import IO, Any

import matplotlib
from matplotlib.figure import Figure

#: Width in inches: an article's text column. Sizes below are points at this width.
WIDTH = 7.0

#: Colours that stay apart for colour-blind eyes and in grey print (Okabe & Ito, 2008).
MEASURED, SIMULATED, RESIDUAL = "#3a3a3a", "#d55e00", "#0072b2"

#: Of what frames the data: segment boundaries, bands, remarks.
FRAME, SHADE = "#8c8c8c", "#e4e4e4"

#: A measured line is broad and lies under the thin simulated one, so that both are seen where they agree.
MEASURED_WIDTH, SIMULATED_WIDTH = 2.2, 0.8

#: Points of a remark inside a figure.
REMARK = 7.5

#: Ticks of a low panel fall on multiples of these.
STEPS = (1, 2, 2.5, 5, 10)

#: Characters of a title's line.
_TITLE = 80

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
    "font.family": ["DejaVu Sans"],  # the one font that matplotlib brings along
    "font.size": 8.5,
    "grid.color": "#ececec",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
    "lines.solid_joinstyle": "round",  # a mitred peak would reach beyond its sample
    "svg.fonttype": "path",  # looks the same where the font is missing
    "svg.hashsalt": "islands",
    "text.parse_math": False,  # a $ or _ of a column's name is no formula
    "xtick.labelsize": 8.0,
    "xtick.major.width": 0.7,
    "ytick.labelsize": 8.0,
    "ytick.major.width": 0.7,
}


@contextmanager
def house_style() -> Iterator[None]:
    """Draw in the house style; as a decorator or in a ``with``. What was set before holds again after it."""
    settings: dict[Any, Any] = {**matplotlib.rcParamsDefault, **_STYLE}
    settings.pop("backend", None)
    with matplotlib.rc_context(settings):
        yield


def blank(height: float, title: str = "") -> Figure:
    """Return an empty figure of the house's width and a height in inches, its title at the left."""
    figure = Figure(figsize=(WIDTH, height))
    if title:
        lines = (fill(line, _TITLE) for line in title.splitlines())
        figure.suptitle("\n".join(lines), x=0.01, ha="left")
    return figure


def finish(figure: Figure) -> Figure:
    """Return a finished figure laid out for good: each new layout would move it by part of a point."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return figure


def label(name: str, unit: str) -> str:
    """Return a column as an axis shows it: ``y (um)`` for ``y_um`` or ``y [um]`` in um."""
    if not unit:
        return name
    for suffix in (f"_{unit}", f"[{unit}]", f"({unit})"):
        if name.endswith(suffix):
            name = name.removesuffix(suffix).rstrip()
            break
    return f"{name} ({unit})".lstrip()


def save(figure: Figure, path: str | Path | IO[bytes]) -> None:
    """Write a figure as SVG; the same content gives the same bytes.

    Parameters
    ----------
    figure : Figure
        Made by one of the house's functions.
    path : str, Path or stream
        The file, whose folder exists, or where else its bytes go.
    """
    with house_style():
        figure.savefig(path, format="svg", metadata={"Date": None, "Creator": "islands"})
