"""The course of a search, and what size buys: error against generations, and error against terms."""

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from islands.figures.style import MEASURED, SIMULATED, blank, house_style, settled
from islands.validation.findings import Findings


@house_style()
def draw_convergence(findings: Findings) -> Figure:
    """Draw the least error of every size over the generations."""
    figure = blank(3.4)
    axes = figure.subplots()
    history = findings.search.history
    sizes = sorted({size for point in history for size in point.best})
    for position, size in enumerate(sizes):
        points = [(point.generation, point.best[size]) for point in history if size in point.best]
        generations, errors = zip(*points, strict=True)
        shade = colormaps["viridis"](0.9 * position / max(1, len(sizes) - 1))
        axes.step(generations, np.sqrt(errors), where="post", color=shade, label=str(size))
    axes.set_yscale("log")
    axes.set_xlabel("generation")
    axes.set_ylabel("RMSE of multiple shooting")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(title="terms", loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return settled(figure)


@house_style()
def draw_front(findings: Findings) -> Figure:
    """Draw the free-run error of every model against its number of terms."""
    figure = blank(3.2)
    axes = figure.subplots()
    for part, colour, marker in (("estimation", MEASURED, "o"), ("validation", SIMULATED, "s")):
        points = sorted(
            (entry.model.size, entry.assessment.metrics[part]["free_run"].mape) for entry in findings.models
        )
        sizes, errors = zip(*points, strict=True)
        axes.plot(sizes, errors, marker=marker, color=colour, label=part)
    axes.set_yscale("log")
    axes.set_xlabel("terms")
    axes.set_ylabel("free-run MAPE (% of the range)")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(frameon=False)
    return settled(figure)
