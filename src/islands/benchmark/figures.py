"""One figure of each scaling: the measured points and the line through them."""

from collections.abc import Iterable
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from islands.benchmark.scaling import Scaling, line_through
from islands.figures.style import MEASURED, RESIDUAL, SIMULATED, blank, house_style, save, settled

_LOOKS = ((SIMULATED, "o"), (RESIDUAL, "s"), (MEASURED, "^"))


@house_style()
def draw_scaling(scaling: Scaling) -> Figure:
    """Draw a cost against what it grows with; the legend tells how well a line explains each curve."""
    figure = blank(3.2)
    axes = figure.subplots()
    for (name, points), (colour, marker) in zip(scaling.curves.items(), cycle(_LOOKS), strict=False):
        x, y = np.array(points).T
        line = line_through(points)
        # Two points are always on a line.
        told = f"{name}, line with R² = {line.r2:.4f}" if len(points) > 2 else name
        axes.plot(x, y, marker, color=colour, markersize=4, label=told)
        ends = np.array([x[0], x[-1]])
        axes.plot(ends, line.intercept + line.slope * ends, color=colour, lw=0.8)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(scaling.x_label)
    axes.set_ylabel(scaling.y_label)
    axes.legend()
    return settled(figure)


def save_scalings(scalings: Iterable[Scaling], folder: Path) -> tuple[Path, ...]:
    """Write a figure of every scaling as SVG; return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for scaling in scalings:
        path = folder / f"{scaling.name}.svg"
        save(draw_scaling(scaling), path)
        written.append(path)
    return tuple(written)
