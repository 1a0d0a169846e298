"""The course of a search, and what size buys: error against generations, and error against terms."""

from math import ceil

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogFormatter, MaxNLocator

from islands.evolution.search_result import SearchResult
from islands.figures.style import MEASURED, SIMULATED, blank, finish, house_style

#: Sizes in a column of a legend that is as high as its figure.
_COLUMN = 15


@house_style()
def draw_convergence(found: SearchResult) -> Figure:
    """Draw the least error of every size over the generations."""
    figure = blank(3.4)
    axes = figure.subplots()
    history = found.search.history
    sizes = sorted({size for point in history for size in point.best})
    for position, size in enumerate(sizes):
        points = [(point.generation, point.best[size]) for point in history if size in point.best]
        generations, errors = zip(*points, strict=True)
        shade = colormaps["viridis"](0.9 * position / max(1, len(sizes) - 1))
        # A line of one generation is a point.
        (line,) = axes.step(generations, np.sqrt(errors), where="post", color=shade, label=str(size))
        line.set(marker="o" if len(points) == 1 else "", markersize=3)
    _against_generations(axes)
    columns = ceil(len(sizes) / _COLUMN)
    axes.legend(title="terms", loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, ncols=columns)
    return finish(figure)


@house_style()
def draw_islands(found: SearchResult) -> Figure:
    """Draw the least error of every island over the generations, and the best of all."""
    figure = blank(3.4)
    axes = figure.subplots()
    history = found.search.history
    generations = [point.generation for point in history]
    errors = np.sqrt([point.islands for point in history])
    errors[np.isinf(errors)] = np.nan
    # A hundred lines are a cloud: it says how far islands are apart, and none of them needs a name.
    name = iter(["one island"])
    for course in errors.T:
        axes.step(
            generations, course, where="post", color=MEASURED, lw=0.8, alpha=0.6, label=next(name, None)
        )
    best = np.fmin.reduce(errors, axis=1)
    axes.step(generations, best, where="post", color=SIMULATED, lw=1.6, label="the best of all")
    _against_generations(axes)
    axes.legend(frameon=False)
    return finish(figure)


@house_style()
def draw_front(found: SearchResult) -> Figure:
    """Draw the free-run error of every model against its number of terms."""
    figure = blank(3.2)
    axes = figure.subplots()
    for part, colour, marker in (("estimation", MEASURED, "o"), ("validation", SIMULATED, "s")):
        points = sorted(
            (entry.model.size, entry.assessment.metrics[part]["free_run"].mape) for entry in found.models
        )
        sizes, errors = zip(*points, strict=True)
        axes.plot(sizes, errors, marker=marker, color=colour, label=part)
    _logarithmic(axes)
    axes.set_xlabel("terms")
    axes.set_ylabel("free-run MAPE (% of the range)")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.legend(frameon=False)
    return finish(figure)


def _against_generations(axes: Axes) -> None:
    _logarithmic(axes)
    axes.set_xlabel("generation")
    axes.set_ylabel("RMSE of multiple shooting")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def _logarithmic(axes: Axes) -> None:
    """Scale the errors by decades, labelled with plain numbers."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
    # Within a decade there may be no power of ten: then numbers between them are written.
    axes.yaxis.set_minor_formatter(_Between(minor_thresholds=(1.0, 0.5)))


class _Between(LogFormatter):
    """Writes a number where matplotlib would, and plainly."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return f"{x:g}" if super().__call__(x, pos) else ""
