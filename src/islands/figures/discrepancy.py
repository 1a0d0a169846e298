"""Figures of a diagnosis: where a simulation errs, before and after, and the ladder of causes."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from islands.discrepancy.diagnosis import Diagnosis
from islands.figures.style import (
    FRAME,
    MEASURED,
    MEASURED_WIDTH,
    RESIDUAL,
    SHADE,
    SIMULATED,
    SIMULATED_WIDTH,
    blank,
    house_style,
    label,
    settled,
)
from islands.figures.thinning import thin

#: Colour of the simulation as it was, where both are drawn.
BEFORE = "#e69f00"

#: Rungs of the ladder that are shown, and cells of a map.
_RUNGS, _CELLS = 12, 40


@house_style()
def draw_over_time(diagnosis: Diagnosis) -> Figure:
    """Draw measured and simulated output over time, and the residuals before and after below."""
    record = diagnosis.record
    figure = blank(4.6, "Measured and simulated output")
    above, below = figure.subplots(2, 1, height_ratios=(2, 1.3), sharex=True)
    time = record.time
    above.plot(*thin(time, record.y), color=MEASURED, lw=MEASURED_WIDTH, label="measured")
    above.plot(*thin(time, diagnosis.base.output), color=BEFORE, lw=SIMULATED_WIDTH, label="simulated")
    below.plot(
        *thin(time, record.y - diagnosis.base.output), color=BEFORE, lw=SIMULATED_WIDTH, label="before"
    )
    if diagnosis.best is not diagnosis.base:
        above.plot(*thin(time, diagnosis.best.output), color=SIMULATED, lw=SIMULATED_WIDTH, label="extended")
        below.plot(
            *thin(time, record.y - diagnosis.best.output), color=RESIDUAL, lw=SIMULATED_WIDTH, label="after"
        )
    for axes in (above, below):
        axes.axvspan(
            float(time[diagnosis.fitted]), float(time[-1]), facecolor=SHADE, edgecolor="none", zorder=0.5
        )
        axes.set_xlim(float(time[0]), float(time[-1]))
    above.set_ylabel(label(record.output_name, record.output_unit))
    above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)
    below.set(
        xlabel="time (s); shaded: locked away until the end", ylabel=label("residual", record.output_unit)
    )
    below.legend(loc="upper left", ncols=2)
    figure.align_ylabels()
    return settled(figure)


@house_style()
def draw_loops(diagnosis: Diagnosis) -> Figure:
    """Draw the loop of output over input, measured, and the residual over input before and after."""
    record = diagnosis.record
    figure = blank(3.4, "Loops")
    left, right = figure.subplots(1, 2)
    u = record.u[:, 0]
    tail = slice(max(0, record.samples - 4000), record.samples)
    left.plot(u[tail], record.y[tail], color=MEASURED, lw=MEASURED_WIDTH, label="measured")
    left.plot(u[tail], diagnosis.best.output[tail], color=SIMULATED, lw=SIMULATED_WIDTH, label="simulated")
    left.legend(loc="upper left")
    _scatter(right, u, diagnosis)
    left.set(xlabel=_input(diagnosis), ylabel=label(record.output_name, record.output_unit))
    right.set(xlabel=_input(diagnosis), ylabel=label("residual", record.output_unit))
    return settled(figure)


@house_style()
def draw_residual(diagnosis: Diagnosis) -> Figure:
    """Draw the residual against what it should not know: input, rate, output; and its autocorrelation."""
    record = diagnosis.record
    u = record.u[:, 0]
    rate = np.gradient(u, record.dt)
    figure = blank(4.8, "What the residual still knows: means of equally full cells, and their spread")
    axes = figure.subplots(2, 2)
    unit = record.input_units[0]
    for panel, signal, name in (
        (axes[0, 0], u, _input(diagnosis)),
        (axes[0, 1], rate, label("rate of the input", f"{unit}/s" if unit else "")),
        (axes[1, 0], diagnosis.best.output, label("simulated output", record.output_unit)),
    ):
        _cells(panel, signal, diagnosis)
        panel.set(xlabel=name, ylabel=label("residual", record.output_unit))
    _autocorrelation(axes[1, 1], diagnosis)
    axes[0, 0].legend(loc="best")
    return settled(figure)


@house_style()
def draw_ladder(diagnosis: Diagnosis) -> Figure:
    """Draw what each effect alone would gain, and the share of the misfit that it explains."""
    shown = diagnosis.candidates[:_RUNGS][::-1]
    named = {finding.name for finding in diagnosis.effects}
    figure = blank(0.9 + 0.26 * len(shown), "The ladder: each effect alone beside the calibrated simulation")
    axes = figure.subplots()
    places = np.arange(len(shown))
    gains = [candidate.score for candidate in shown]
    colours = [SIMULATED if candidate.name in named else FRAME for candidate in shown]
    axes.barh(places, gains, color=colours, height=0.7)
    axes.set_yticks(places, [candidate.name for candidate in shown])
    axes.axvline(0.0, color=FRAME, lw=0.6)
    for place, candidate in zip(places, shown, strict=True):
        axes.annotate(
            f"{100 * candidate.eta:.0f} %",
            (max(candidate.score, 0.0), float(place)),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
        )
    axes.margins(x=0.12)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("gain in minus twice the log-likelihood, values paid for; percent: share of the misfit")
    return settled(figure)


def _input(diagnosis: Diagnosis) -> str:
    return label(diagnosis.record.input_names[0], diagnosis.record.input_units[0])


def _residuals(diagnosis: Diagnosis) -> list[tuple[str, str, NDArray[np.float64]]]:
    y = diagnosis.record.y
    before = [("before", BEFORE, y - diagnosis.base.output)]
    if diagnosis.best is diagnosis.base:
        return before
    return [*before, ("after", RESIDUAL, y - diagnosis.best.output)]


def _scatter(axes: Axes, x: NDArray[np.float64], diagnosis: Diagnosis) -> None:
    every = max(1, x.size // 3000)
    for name, colour, residual in _residuals(diagnosis):
        axes.plot(x[::every], residual[::every], ".", ms=1.2, color=colour, label=name, rasterized=True)
    axes.legend(loc="best", markerscale=6)


def _cells(axes: Axes, signal: NDArray[np.float64], diagnosis: Diagnosis) -> None:
    edges = np.quantile(signal, np.linspace(0.0, 1.0, _CELLS + 1))
    cell = np.clip(np.searchsorted(edges, signal, side="right") - 1, 0, _CELLS - 1)
    middle = (edges[1:] + edges[:-1]) / 2
    for name, colour, residual in _residuals(diagnosis):
        count = np.maximum(np.bincount(cell, minlength=_CELLS), 1)
        mean = np.bincount(cell, weights=residual, minlength=_CELLS) / count
        spread = np.sqrt(np.bincount(cell, weights=residual**2, minlength=_CELLS) / count - mean**2)
        axes.fill_between(middle, mean - spread, mean + spread, color=colour, alpha=0.15, lw=0)
        axes.plot(middle, mean, color=colour, lw=1.2, label=name)
    axes.axhline(0.0, color=FRAME, lw=0.6, zorder=1)


def _autocorrelation(axes: Axes, diagnosis: Diagnosis) -> None:
    for name, colour, residual in _residuals(diagnosis):
        centred = residual - residual.mean()
        lags = np.arange(1, 51)
        correlation = [float(centred[lag:] @ centred[:-lag] / (centred @ centred)) for lag in lags]
        axes.plot(lags, correlation, color=colour, lw=1.2, label=name)
    bound = 1.96 / np.sqrt(diagnosis.record.samples)
    axes.axhspan(-bound, bound, color=SHADE, zorder=0.5)
    axes.set(xlabel="lag (samples)", ylabel="autocorrelation of the residual")


#: Name to drawing, in the order of a report.
DISCREPANCY_FIGURES: Mapping[str, Callable[[Diagnosis], Figure]] = MappingProxyType(
    {"over-time": draw_over_time, "loops": draw_loops, "residual": draw_residual, "ladder": draw_ladder}
)
