"""Matrix of the strengths at which an experiment separates causes."""

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from islands.diagnosis.planning.isolability import Isolability
from islands.report.figures.style import FRAME, RESIDUAL, SHADE, SIMULATED, WIDTH, blank, finish, house_style

#: Smallest margin for the names, in inches, and their width per character and point of font size.
_MIN_MARGIN, _CHARACTER = 1.2, 0.62 / 72

#: Height of the legend in inches.
_LEGEND = 0.65

#: Largest width of a cell, in inches.
_CELL = 0.3

#: Font size of names per inch of cell width, in points, and the largest one.
_NAMES_PER_INCH, _MAX_NAMES = 46.0, 8.0

#: Font size of numbers per inch of cell width, in points.
_NUMBERS_PER_INCH = 24.0

#: Misfits between which colours change, in standard deviations of the noise.
_RANGE = (0.1, 10.0)

#: Numbers are left out of cells with strengths within this factor of the smallest detectable one.
_SAME = 1.05


@house_style()
def draw_separability(isolability: Isolability, title: str = "") -> Figure:
    """Draw the strength at which each cause (row) is separable from each other one (column).

    Strengths are misfits in standard deviations of the noise. Light blue cells are separable when the cause
    is detected, darker ones only at the larger strength in the cell, and orange ones at none. Rows of
    undetectable causes are grey.
    """
    names, misfits = isolability.names, isolability.misfits
    count = len(names)
    margin = max(_MIN_MARGIN, 0.1 + _CHARACTER * _MAX_NAMES * max(map(len, names)))
    cell = min(_CELL, (WIDTH - margin - 0.1) / count)
    top = 0.35 if title else 0.1
    height = cell * count + margin + _LEGEND + top
    figure = blank(height, title)
    figure.set_layout_engine("none")  # cells are squares of a fixed size
    size = cell * count
    axes = figure.add_axes((margin / WIDTH, _LEGEND / height, size / WIDTH, size / height))
    shades = LinearSegmentedColormap.from_list("separability", ["#dcebf5", RESIDUAL, "#00304d"])
    colours = shades.with_extremes(over=SIMULATED, bad=SHADE)
    finite = np.where(np.isinf(misfits), 1e9, misfits)
    edges = np.arange(count + 1)
    mesh = axes.pcolormesh(
        edges,
        edges,
        np.ma.masked_invalid(finite),
        cmap=colours,
        norm=LogNorm(*_RANGE),
        edgecolor="white",
        lw=0.4,
        rasterized=True,  # a path for each cell makes the file three times as large
    )
    for down, row in enumerate(isolability.rows):
        for across, misfit in enumerate(row.misfits):
            if row.detectable is not None and _SAME * row.detectable.misfit < misfit < np.inf:
                shade = "white" if misfit > 0.5 else "black"
                axes.text(
                    across + 0.5,
                    down + 0.53,
                    f"{misfit:.1g}" if misfit < 1.0 else f"{misfit:.2g}",
                    ha="center",
                    va="center",
                    fontsize=_NUMBERS_PER_INCH * cell,
                    color=shade,
                )
    axes.set(xlim=(0, count), ylim=(count, 0))
    axes.set_xticks(edges[:-1] + 0.5, names, rotation=90)
    axes.set_yticks(edges[:-1] + 0.5, names)
    font = min(_MAX_NAMES, _NAMES_PER_INCH * cell)
    axes.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=0, labelsize=font)
    axes.grid(visible=False)
    for side in axes.spines.values():
        side.set(visible=True, color=FRAME)
    bar = figure.add_axes((margin / WIDTH, 0.42 / height, 0.45 * size / WIDTH, 0.09 / height))
    figure.colorbar(mesh, cax=bar, orientation="horizontal", ticks=[0.1, 1.0, 10.0], format="%g")
    bar.tick_params(labelsize=7.0, which="both", length=2)
    bar.set_xlabel("separable from this misfit on, in noise standard deviations", fontsize=7.0, labelpad=1)
    axes.legend(
        handles=[Patch(color=SIMULATED, label="at no strength"), Patch(color=SHADE, label="not detectable")],
        loc="upper right",
        bbox_to_anchor=(1.0, -0.02 * _CELL / cell),
        ncols=2,
        fontsize=7.0,
    )
    return finish(figure)
