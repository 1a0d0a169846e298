"""Figures of a diagnosis: where a simulation errs, before and after, and the ladder of causes."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, StrMethodFormatter
from numpy.typing import NDArray

from islands.discrepancy.diagnosis import Diagnosis
from islands.discrepancy.interfaces.context import Signal
from islands.figures.downsampling import VERTICES, thin
from islands.figures.style import (
    FRAME,
    MEASURED,
    MEASURED_WIDTH,
    RESIDUAL,
    SHADE,
    SIMULATED,
    SIMULATED_WIDTH,
    STEPS,
    blank,
    finish,
    house_style,
    label,
)
from islands.figures.windows import last_loops, representative_window

#: Colour of the simulation as it was, where both are drawn.
BEFORE = "#e69f00"

#: Rungs of the ladder that are shown, cells of a map, lags of an autocorrelation, windows of a spectrum.
_RUNGS, _CELLS, _LAGS, _WINDOWS = 12, 40, 50, 4

#: Vertices of a line that is shown as a whole above and in part below.
_WHOLE = 800


@house_style()
def draw_over_time(diagnosis: Diagnosis) -> Figure:
    """Draw measured and simulated output over time, and the residuals before and after below.

    A record of many loops is shown as a whole and, below, in a stretch whose residual is the median of all
    such stretches: as a whole it is a band.
    """
    record = diagnosis.record
    stretch = representative_window(record, record.y - diagnosis.base.output)
    if stretch is None:
        figure = blank(4.6, "Measured and simulated output")
        axes = figure.subplots(2, 1, height_ratios=(2, 1.3))
        _over_time(axes[0], axes[1], diagnosis, slice(0, record.samples))
    else:
        figure = blank(7.4, "Measured and simulated output")
        axes = figure.subplots(4, 1, height_ratios=(1.6, 1.1, 2.2, 1.3))
        _over_time(axes[0], axes[1], diagnosis, slice(0, record.samples), 0.6)
        _over_time(axes[2], axes[3], diagnosis, stretch)
        here = record.time[stretch]
        for whole in axes[:2]:
            whole.axvspan(float(here[0]), float(here[-1]), facecolor="none", edgecolor=FRAME, lw=0.8)
        axes[2].set_title("The framed stretch: its residual before is of median size", fontsize=8.0)
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)
    axes[1].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.0)
    axes[-1].set_xlabel("time (s); shaded: locked away until the end")
    figure.align_ylabels()
    return finish(figure)


@house_style()
def draw_loops(diagnosis: Diagnosis) -> Figure:
    """Draw the last loops of output over input, and of the residual before and after."""
    record = diagnosis.record
    figure = blank(3.4, "Loops")
    left, right = figure.subplots(1, 2)
    u, loops = record.u[:, 0], last_loops(record)
    left.plot(*thin(u[loops], record.y[loops]), color=MEASURED, lw=MEASURED_WIDTH, label="measured")
    for name, colour, output in _outputs(diagnosis):
        left.plot(*thin(u[loops], output[loops]), color=colour, lw=SIMULATED_WIDTH, label=name)
    left.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2, columnspacing=1.0)
    for name, colour, residual in _residuals(diagnosis):
        right.plot(*thin(u[loops], residual[loops]), color=colour, lw=SIMULATED_WIDTH, label=name)
    right.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    left.set(xlabel=_input(diagnosis), ylabel=label(record.output_name, record.output_unit))
    right.set(xlabel=_input(diagnosis), ylabel=label("residual", record.output_unit))
    for axes in (left, right):
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=STEPS))
    return finish(figure)


@house_style()
def draw_residual(diagnosis: Diagnosis) -> Figure:
    """Draw the residual against what it should not know.

    Those are the input, also by its direction, its rate and the simulated output; then its spectrum and its
    autocorrelation.
    """
    record = diagnosis.record
    u = record.u[:, 0]
    rate = np.gradient(u, record.dt)
    figure = blank(7.0, "What the residual still knows: means of equally full cells, and their spread")
    axes = figure.subplots(3, 2)
    axes[0, 1].sharey(axes[0, 0])
    unit = record.input_units[0]
    for panel, signal, name in (
        (axes[0, 0], u, _input(diagnosis)),
        (axes[1, 0], rate, label("rate of the input", f"{unit}/s" if unit else "")),
        (axes[1, 1], diagnosis.best.output, label("simulated output", record.output_unit)),
    ):
        _cells(panel, signal, diagnosis)
        panel.set(xlabel=name, ylabel=label("residual", record.output_unit))
    _directions(axes[0, 1], u, rate, diagnosis)
    _spectrum(axes[2, 0], diagnosis)
    _autocorrelation(axes[2, 1], diagnosis)
    for panel in axes[:2].flat:
        panel.yaxis.set_major_locator(MaxNLocator(5, steps=STEPS))
    axes[0, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    return finish(figure)


@house_style()
def draw_screening(diagnosis: Diagnosis) -> Figure:
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
            f"{100 * candidate.explained_fraction:.0f} %",
            (max(candidate.score, 0.0), float(place)),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
        )
    axes.margins(x=0.12)
    axes.set_xlim(left=1.05 * min(0.0, *gains))
    axes.grid(visible=False, axis="y")
    axes.set_xlabel(
        "gain in minus twice the log-likelihood, values paid for; percent: of the misfit; coloured: named"
    )
    return finish(figure)


def _input(diagnosis: Diagnosis) -> str:
    return label(diagnosis.record.input_names[0], diagnosis.record.input_units[0])


def _outputs(diagnosis: Diagnosis) -> list[tuple[str, str, Signal]]:
    """Return what is simulated, each with its name and its colour."""
    before = [("simulated", BEFORE, diagnosis.base.output)]
    if diagnosis.best is diagnosis.base:
        return before
    return [*before, ("extended", SIMULATED, diagnosis.best.output)]


def _residuals(diagnosis: Diagnosis) -> list[tuple[str, str, Signal]]:
    """Return what each of these leaves over."""
    outputs = _outputs(diagnosis)
    names = (("residual", BEFORE),) if len(outputs) == 1 else (("before", BEFORE), ("after", RESIDUAL))
    return [
        (name, colour, diagnosis.record.y - output)
        for (name, colour), (_, _, output) in zip(names, outputs, strict=True)
    ]


def _over_time(above: Axes, below: Axes, diagnosis: Diagnosis, part: slice, weight: float = 1.0) -> None:
    record = diagnosis.record
    time = record.time[part]
    most = VERTICES if weight == 1.0 else _WHOLE
    measured = thin(time, record.y[part], most)
    above.plot(*measured, color=MEASURED, lw=weight * MEASURED_WIDTH, label="measured")
    for panel, lines in ((above, _outputs(diagnosis)), (below, _residuals(diagnosis))):
        for name, colour, line in lines:
            drawn = thin(time, line[part], most)
            panel.plot(*drawn, color=colour, lw=weight * SIMULATED_WIDTH, label=name)
        first = max(float(record.time[diagnosis.estimation_samples]), float(time[0]))
        if first < time[-1]:
            panel.axvspan(first, float(time[-1]), facecolor=SHADE, edgecolor="none", zorder=0.5)
        panel.set_xlim(float(time[0]), float(time[-1]))
        panel.yaxis.set_major_locator(MaxNLocator(5, steps=STEPS))
    above.tick_params(labelbottom=False)
    above.set_ylabel(label(record.output_name, record.output_unit))
    below.set_ylabel(label("residual", record.output_unit))


def _cells(axes: Axes, signal: Signal, diagnosis: Diagnosis) -> None:
    middle, cell, count = _equally_full(signal)
    for name, colour, residual in _residuals(diagnosis):
        mean = np.bincount(cell, weights=residual) / count
        spread = np.sqrt(np.maximum(np.bincount(cell, weights=residual**2) / count - mean**2, 0.0))
        axes.fill_between(middle, mean - spread, mean + spread, color=colour, alpha=0.15, lw=0)
        axes.plot(middle, mean, color=colour, lw=1.2, label=name)
    axes.axhline(0.0, color=FRAME, lw=0.6, zorder=1)


def _directions(axes: Axes, u: Signal, rate: Signal, diagnosis: Diagnosis) -> None:
    """Draw the means while the input rises and while it falls: where they differ something remembers."""
    for way, rises, line in (("rising", True, "-"), ("falling", False, (0, (3, 1.5)))):
        chosen = (rate > 0.0) == rises
        if not chosen.any():
            continue
        middle, cell, count = _equally_full(u[chosen])
        for _, colour, residual in _residuals(diagnosis):
            mean = np.bincount(cell, weights=residual[chosen]) / count
            axes.plot(middle, mean, color=colour, lw=1.2, ls=line)
        axes.plot([], [], color=FRAME, lw=1.2, ls=line, label=way)
    axes.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
    axes.set(xlabel=_input(diagnosis), ylabel=label("residual", diagnosis.record.output_unit))
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)


def _equally_full(signal: Signal) -> tuple[Signal, NDArray[np.int64], NDArray[np.int64]]:
    """Sort samples into cells; return each cell's mean, the cell of each sample, and how many are in one.

    Of a signal with few levels there are fewer cells: none is empty.
    """
    edges = np.unique(np.quantile(signal, np.linspace(0.0, 1.0, _CELLS + 1)[1:-1]))
    _, cell = np.unique(np.searchsorted(edges, signal, side="right"), return_inverse=True)
    count = np.bincount(cell)
    return np.bincount(cell, weights=signal) / count, cell, count


def _spectrum(axes: Axes, diagnosis: Diagnosis) -> None:
    """Draw the residual's spectral densities: Welch's, with windows of a quarter of the record."""
    record = diagnosis.record
    for _, colour, residual in _residuals(diagnosis):
        frequency, density = scipy.signal.welch(
            residual, 1.0 / record.dt, nperseg=max(16, record.samples // _WINDOWS)
        )
        axes.plot(frequency[1:], np.sqrt(density[1:]), color=colour, lw=1.0)
    axes.set(xscale="log", yscale="log", xlabel="frequency (Hz)")
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        # Powers of ten alone would be one label or none.
        if high < 100.0 * low:
            subs = (2.0, 5.0) if high > 10.0 * low else (2.0, 3.0, 5.0, 7.0)
            axis.set_minor_locator(LogLocator(subs=subs))
            axis.set_minor_formatter(StrMethodFormatter("{x:g}"))
    axes.set_ylabel(label("residual", f"{record.output_unit or '1'}/Hz^0.5"))


def _autocorrelation(axes: Axes, diagnosis: Diagnosis) -> None:
    for name, colour, residual in _residuals(diagnosis):
        centred = residual - residual.mean()
        lags = np.arange(1, min(_LAGS, residual.size - 1) + 1)
        correlation = [float(centred[lag:] @ centred[:-lag] / (centred @ centred)) for lag in lags]
        axes.plot(lags, correlation, color=colour, lw=1.2, label=name)
    bound = 1.96 / np.sqrt(diagnosis.record.samples)
    axes.axhspan(-bound, bound, color=SHADE, zorder=0.5)
    axes.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
    axes.set(xlabel="lag (samples)", ylabel="autocorrelation")


#: Name to drawing, in the order of a report.
DISCREPANCY_FIGURES: Mapping[str, Callable[[Diagnosis], Figure]] = MappingProxyType(
    {"over-time": draw_over_time, "loops": draw_loops, "residual": draw_residual, "ladder": draw_screening}
)
