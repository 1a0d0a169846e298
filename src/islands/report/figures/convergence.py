"""Convergence of a search: error against generations, and error against the number of terms."""

from collections.abc import Mapping, Sequence
from math import ceil
from typing import cast

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from islands.evolution.search_result import SearchResult
from islands.models.parametric import ParametricModel
from islands.report.figures.style import (
    MEASURED,
    RESIDUAL,
    SIMULATED,
    blank,
    finish,
    house_style,
    set_log_scale,
)

#: Entries of a legend column.
_LEGEND_ROWS = 15


@house_style()
def draw_convergence(result: SearchResult) -> Figure:
    """Draw the best error of every model size over the generations."""
    figure = blank(3.4)
    axes = figure.subplots()
    history = result.search.history
    sizes = sorted({size for point in history for size in point.best})
    for position, size in enumerate(sizes):
        points = [(point.generation, point.best[size]) for point in history if size in point.best]
        generations, errors = zip(*points, strict=True)
        shade = colormaps["plasma"](0.6 * position / max(1, len(sizes) - 1))
        # A line through one point is invisible, so draw a marker.
        (line,) = axes.step(generations, np.sqrt(errors), where="post", color=shade, label=str(size))
        line.set(marker="o" if len(points) == 1 else "", markersize=3)
    _set_generation_axes(axes)
    columns = ceil(len(sizes) / _LEGEND_ROWS)
    axes.legend(title="terms", loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, ncols=columns)
    return finish(figure)


@house_style()
def draw_islands(result: SearchResult) -> Figure:
    """Draw the best error of every island and of all islands over the generations."""
    figure = blank(3.4)
    axes = figure.subplots()
    history = result.search.history
    generations = [point.generation for point in history]
    errors = np.sqrt([point.islands for point in history])
    errors[np.isinf(errors)] = np.nan
    # The lines show only the spread of the islands, so one legend entry is enough for all.
    name = iter(["one island"])
    for course in errors.T:
        axes.step(
            generations, course, where="post", color=MEASURED, lw=0.8, alpha=0.6, label=next(name, None)
        )
    best = np.fmin.reduce(errors, axis=1)
    axes.step(generations, best, where="post", color=SIMULATED, lw=1.6, label="best island")
    _set_generation_axes(axes)
    axes.legend(frameon=False)
    return finish(figure)


@house_style()
def draw_front(result: SearchResult) -> Figure:
    """Draw the free-run error of every model against its size, and mark the recommended model."""
    figure = blank(3.2)
    axes = figure.subplots()
    for part, colour, marker in (("estimation", MEASURED, "o"), ("validation", SIMULATED, "s")):
        points = sorted(
            (entry.model.free_size, entry.metrics[part]["free_run"].mape) for entry in result.models
        )
        sizes, errors = zip(*points, strict=True)
        axes.plot(sizes, errors, marker=marker, color=colour, label=part)
    chosen = result.recommended
    error = chosen.metrics["validation"]["free_run"].mape
    axes.plot(chosen.model.free_size, error, "o", ms=13, mfc="none", color=RESIDUAL, label="recommended")
    set_log_scale(axes)
    axes.set_xlabel("parameters" if isinstance(chosen.model, ParametricModel) else "terms")
    axes.set_ylabel("free-run MAPE (% of the range)")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.legend(frameon=False)
    return finish(figure)


@house_style()
def draw_fronts(
    fronts: Mapping[str, Sequence[tuple[int, float]]],
    marked: Mapping[str, tuple[int, float]],
    data: str,
    ax: Axes | None = None,
) -> Figure:
    """Draw the errors of the models of several results against their numbers of terms.

    Parameters
    ----------
    fronts : mapping
        Numbers of terms and RMSE of the models of each result, by its name; NaN is left out.
    marked : mapping
        The recommended model of each result.
    data : str
        What the errors were measured on, for the title.
    ax : Axes, optional
        Axes to draw into; by default those of a new figure.
    """
    figure = blank(3.2) if ax is None else cast("Figure", ax.get_figure(root=True))
    axes = figure.subplots() if ax is None else ax
    for (name, points), colour, marker in zip(fronts.items(), (MEASURED, SIMULATED), "os", strict=True):
        sizes, errors = zip(*sorted(points), strict=True)
        axes.plot(sizes, errors, marker=marker, color=colour, label=name)
        axes.plot(*marked[name], "o", ms=13, mfc="none", color=RESIDUAL)
    axes.plot([], [], "o", ms=9, mfc="none", color=RESIDUAL, label="recommended")
    set_log_scale(axes)
    axes.set_xlabel("terms")
    axes.set_ylabel("free-run RMSE")
    axes.set_title(data, fontsize=8.0)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.legend(frameon=False)
    return finish(figure) if ax is None else figure


def _set_generation_axes(axes: Axes) -> None:
    set_log_scale(axes)
    axes.set_xlabel("generation")
    axes.set_ylabel("RMSE of multiple shooting")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
