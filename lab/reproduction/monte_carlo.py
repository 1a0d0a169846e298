"""Monte Carlo runs: boxes of errors and sizes by a factor, counts of events, and a scan of a parameter."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from islands.report.figures.style import Theme, blank, finish, set_log_scale, themed_style

#: Width of a box; the factors are at 0, 1, 2, ...
_BOX = 0.3

#: Size of markers in points.
_MARKER = 4.0

#: Smallest ratio of labelled values on a logarithmic axis.
_APART = 1.4


@dataclass(frozen=True, slots=True)
class MonteCarloGroup:
    """Runs with one value of the factor.

    Attributes
    ----------
    label : str
        Value of the factor.
    prediction, simulation : sequence of float
        MAPE of the one-step-ahead prediction and of the free run in per cent; those that are not finite are
        left out.
    sizes : sequence of int
        Numbers of terms.
    unstable : float
        Fraction of the runs whose free run diverges.
    interval : tuple of float
        Confidence interval of that fraction.
    published : float or None
        Fraction in the publication.
    """

    label: str
    prediction: Sequence[float]
    simulation: Sequence[float]
    sizes: Sequence[int]
    unstable: float
    interval: tuple[float, float]
    published: float | None = None


@dataclass(frozen=True, slots=True)
class ScanLine:
    """Fraction of events over a parameter.

    Attributes
    ----------
    label : str
    fractions : sequence of float
    intervals : sequence of tuple of float
        Confidence intervals of the fractions.
    published : float
        Fraction in the publication.
    """

    label: str
    fractions: Sequence[float]
    intervals: Sequence[tuple[float, float]]
    published: float


def draw_groups(panels: Sequence[tuple[str, Sequence[MonteCarloGroup]]], factor: str, theme: str) -> Figure:
    """Draw errors, unstable models and sizes of the groups; one column for each panel.

    Parameters
    ----------
    panels : sequence of (str, sequence of MonteCarloGroup)
        Title and groups of each column.
    factor : str
        Name of the factor, below the columns.
    theme : str
        A key of ``THEMES``.
    """
    with themed_style(theme) as colours:
        figure = blank(6.4)
        rows = figure.subplots(3, len(panels), squeeze=False, sharex="col", height_ratios=(2.2, 1.0, 1.5))
        for place, (title, groups) in enumerate(panels):
            errors, counts, sizes = rows[:, place]
            errors.set_title(title)
            _draw_errors(errors, groups, colours)
            _draw_counts(counts, groups, colours)
            terms = [each.sizes for each in groups]
            _draw_boxes(
                sizes, terms, list(map(_compute_notch, terms)), 0.0, colours.inputs[1 + place % 2], colours
            )
            sizes.set_xticks(range(len(groups)), [each.label for each in groups])
            sizes.set_xlabel(factor)
        for axes, name in zip(rows[:, 0], ("MAPE (%)", "unstable", "terms"), strict=True):
            axes.set_ylabel(name)
        return finish(figure)


def _draw_errors(axes: Axes, groups: Sequence[MonteCarloGroup], colours: Theme) -> None:
    kinds = (
        ("PE, one step", [each.prediction for each in groups], -1, colours.inputs[0]),
        ("SE, free run", [each.simulation for each in groups], 1, colours.mark),
    )
    for name, values, side, colour in kinds:
        finite = [[value for value in group if 0.0 < value < inf] for group in values]
        notches = [np.exp(_compute_notch(np.log(group))) for group in finite if group]
        _draw_boxes(axes, finite, notches, side * 0.6 * _BOX, colour, colours)
        axes.plot([], [], "s", color=colour, label=name)
    set_log_scale(axes)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderpad=0.0, columnspacing=1.0)


def _compute_notch(values: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the interval of the median: 1.57 interquartile ranges over the root of the number, either way.

    Intervals of errors are those of their logarithms: on a logarithmic axis they must not reach zero.
    """
    lower, median, upper = np.quantile(values, (0.25, 0.5, 0.75))
    half = 1.57 * (upper - lower) / np.sqrt(np.size(values))
    return np.array([median - half, median + half])


def _draw_boxes(
    axes: Axes,
    values: Sequence[Sequence[float]],
    notches: Sequence[NDArray[np.float64]],
    shift: float,
    colour: str,
    colours: Theme,
) -> None:
    """Draw a box with a notch for every group that is not empty; ``notches`` has those of these groups."""
    places = [place for place, group in enumerate(values) if len(group)]
    axes.boxplot(
        [values[place] for place in places],
        positions=[place + shift for place in places],
        widths=_BOX,
        notch=True,
        conf_intervals=np.reshape(notches, (-1, 2)),
        patch_artist=True,
        manage_ticks=False,
        boxprops={"facecolor": colour, "edgecolor": colours.text, "linewidth": 0.6, "alpha": 0.85},
        medianprops={"color": colours.text, "linewidth": 1.2},
        whiskerprops={"color": colours.frame},
        capprops={"color": colours.frame},
        flierprops={"marker": ".", "markersize": _MARKER, "markeredgecolor": colour},
    )


def _draw_counts(axes: Axes, groups: Sequence[MonteCarloGroup], colours: Theme) -> None:
    fractions = [each.unstable for each in groups]
    _draw_intervals(
        axes, range(len(groups)), fractions, [each.interval for each in groups], colours.text, "here, 95 %"
    )
    stated = [(place, each.published) for place, each in enumerate(groups) if each.published is not None]
    if stated:
        places, published = zip(*stated, strict=True)
        axes.plot(
            places,
            published,
            "D",
            ms=_MARKER + 4,
            mfc="none",
            color=colours.mark,
            label="published",
            zorder=3,
        )
    axes.set_ylim(-0.05, 1.05)
    axes.set_yticks((0.0, 0.5, 1.0), ("0 %", "50 %", "100 %"))
    axes.legend(loc="best")


def _draw_intervals(
    axes: Axes,
    places: Sequence[float] | range,
    fractions: Sequence[float],
    intervals: Sequence[tuple[float, float]],
    colour: str,
    label: str,
) -> None:
    low, high = np.transpose(intervals)
    reach = [np.maximum(fractions - low, 0.0), np.maximum(high - fractions, 0.0)]
    axes.errorbar(
        places, fractions, yerr=reach, fmt="o", ms=_MARKER, color=colour, lw=1.0, capsize=2.0, label=label
    )


def draw_scan(
    values: Sequence[float],
    lines: Sequence[ScanLine],
    sizes: tuple[str, Sequence[Sequence[int]], tuple[float, float]],
    likelihood: Sequence[float],
    parameter: str,
    theme: str,
) -> Figure:
    """Draw counts, sizes and the likelihood of the published ones over a parameter, on a logarithmic axis.

    Parameters
    ----------
    values : sequence of float
        Values of the parameter.
    lines : sequence of ScanLine
        Fractions of events; at most three.
    sizes : (str, sequence, (float, float))
        Title, numbers of terms at every value, and their published range.
    likelihood : sequence of float
        Logarithm of the likelihood at every value.
    parameter : str
        Name of the parameter.
    theme : str
        A key of ``THEMES``.
    """
    with themed_style(theme) as colours:
        figure = blank(5.6)
        counts, terms, log = figure.subplots(3, 1, sharex=True, height_ratios=(1.6, 1.2, 1.0))
        shades = (colours.inputs[0], colours.inputs[1], colours.mark)
        for place, (line, shade) in enumerate(zip(lines, shades, strict=False)):
            moved = [value * (1.0 + 0.06 * (place - 1)) for value in values]  # intervals side by side
            _draw_intervals(counts, moved, line.fractions, line.intervals, shade, line.label)
            counts.axhline(line.published, color=shade, lw=0.9, ls="--")
        counts.set_ylabel("unstable")
        counts.set_yticks((0.0, 0.5, 1.0), ("0 %", "50 %", "100 %"))
        counts.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title="dashed: published")
        title, found, (least, most) = sizes
        terms.axhspan(least, most, color=colours.grid, label="published")
        medians = [float(np.median(each)) for each in found]
        ranges = [(float(min(each)), float(max(each))) for each in found]
        _draw_intervals(terms, values, medians, ranges, colours.inputs[1], "median and range")
        terms.set_ylabel(f"terms, {title}")
        terms.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        log.plot(values, likelihood, "o-", ms=_MARKER, color=colours.text)
        best = int(np.argmax(likelihood))
        log.plot(values[best], likelihood[best], "o", ms=11, mfc="none", color=colours.mark, clip_on=False)
        log.set_ylabel("log-likelihood")
        log.set_xscale("log")
        ticks: list[float] = []
        for value in values:
            if not ticks or value >= _APART * ticks[-1]:
                ticks.append(value)
        log.set_xticks(ticks, [f"{value:g}" for value in ticks], minor=False)
        log.minorticks_off()
        log.set_xlabel(parameter)
        return finish(figure)
