"""Figures of a diagnosis: simulation and residual before and after extension, and screened effects."""

from collections.abc import Callable, Mapping, Sequence
from math import floor
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, MaxNLocator, StrMethodFormatter
from numpy.typing import NDArray

from islands.diagnosis.discovery.effect_shape import EffectShape
from islands.diagnosis.inference.finding import list_free_forms
from islands.diagnosis.rate_effect import find_rate_effect
from islands.diagnosis.result import Diagnosis
from islands.effects.catalogue import get_title
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect, ForceLaw
from islands.records.dataset import Dataset
from islands.records.inspection.excitation import estimate_spectrum
from islands.records.segments import fill_gaps, map_segments
from islands.report.figures.lines import VERTICES, break_line, downsample, last_loops, representative_window
from islands.report.figures.style import (
    BAND,
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

#: Colour of the simulation before extension.
BEFORE = "#c56fa0"

#: Number of screened effects shown.
_MAX_EFFECTS = 12

#: Cells of a residual map.
_CELLS = 40

#: Largest lag of the autocorrelation, in samples.
_LAGS = 50

#: Length of the record divided by the length of a window of the spectrum.
_WINDOWS = 4

#: Vertices of a line in an overview panel above a section.
_OVERVIEW_VERTICES = 800


@house_style()
def draw_over_time(diagnosis: Diagnosis) -> Figure:
    """Draw measured and simulated output over time, and below them the residuals before and after.

    A record with many loops is shown completely and, below, in a section whose residual is the median of all
    sections, because the loops of the complete record cannot be distinguished. The last panel is the input.
    """
    record = diagnosis.record
    section = representative_window(record, fill_gaps(record.y - diagnosis.base.output))
    if section is None:
        shown = slice(0, record.samples)
        figure = blank(5.6, "Measured and simulated output")
        axes = figure.subplots(3, 1, height_ratios=(2, 1.3, 0.9))
        _draw_over_time_panels(axes[0], axes[1], diagnosis, shown)
    else:
        shown = section
        figure = blank(8.4, "Measured and simulated output")
        axes = figure.subplots(5, 1, height_ratios=(1.6, 1.1, 2.2, 1.3, 0.9))
        _draw_over_time_panels(axes[0], axes[1], diagnosis, slice(0, record.samples), 0.6)
        _draw_over_time_panels(axes[2], axes[3], diagnosis, section)
        here = record.time[section]
        for whole in axes[:2]:
            whole.axvspan(float(here[0]), float(here[-1]), facecolor="none", edgecolor=FRAME, lw=0.8)
        axes[1].tick_params(labelbottom=True)
        axes[2].set_title("The framed section, whose residual is of medium size", fontsize=8.0)
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)
    _draw_input(axes[-1], record, shown)
    axes[-2].tick_params(labelbottom=False)
    axes[-1].set_xlabel("time (s); shaded: excluded from fitting")
    figure.align_ylabels()
    return finish(figure)


@house_style()
def draw_loops(diagnosis: Diagnosis) -> Figure:
    """Draw the last loops of the output, and of the residual before and after, over the input."""
    record = diagnosis.record
    figure = blank(3.4, f"Output and residual over the input, {_name_part(record, last_loops(record))}")
    left, right = figure.subplots(1, 2)
    loops = last_loops(record)
    shown = record[loops]
    u = break_line(shown, shown.u[:, 0])
    measured = downsample(u, break_line(shown, shown.y))
    left.plot(*measured, color=MEASURED, lw=MEASURED_WIDTH, label="measured")
    for name, colour, output in _outputs(diagnosis):
        line = downsample(u, break_line(shown, output[loops]))
        left.plot(*line, color=colour, lw=SIMULATED_WIDTH, label=name)
    left.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2, columnspacing=1.0)
    for _, colour, residual in _residuals(diagnosis):
        line = downsample(u, break_line(shown, residual[loops]))
        right.plot(*line, color=colour, lw=SIMULATED_WIDTH)
    left.set(xlabel=_input_label(diagnosis), ylabel=label(record.output_name, record.output_unit))
    right.set(xlabel=_input_label(diagnosis), ylabel=label("residual", record.output_unit))
    for axes in (left, right):
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=STEPS))
    return finish(figure)


@house_style()
def draw_residual(diagnosis: Diagnosis) -> Figure:
    """Draw the structure of the residual before and after.

    The panels show the residual over the input, over the input by direction, over the rate of the input and
    over the simulated output; its amplitude spectrum; its autocorrelation.
    """
    record = diagnosis.record
    u = record.u[:, 0]
    rate = map_segments(lambda part: np.gradient(part, record.dt), u, record.segments)
    figure = blank(7.2, "Structure of the residual")
    axes = figure.subplots(3, 2)
    axes[0, 1].sharey(axes[0, 0])
    unit = record.input_units[0]
    for panel, signal, name in (
        (axes[0, 0], u, _input_label(diagnosis)),
        (axes[1, 0], rate, label("rate of the input", f"{unit}/s" if unit else "")),
        (axes[1, 1], diagnosis.best.output, label("output of the best simulation", record.output_unit)),
    ):
        draw_cells(panel, signal, _residuals(diagnosis))
        panel.set(xlabel=name, ylabel=label("residual", record.output_unit))
    _draw_directions(axes[0, 1], u, rate, diagnosis)
    _draw_spectrum(axes[2, 0], diagnosis)
    _draw_autocorrelation(axes[2, 1], diagnosis)
    for panel in axes[:2].flat:
        panel.yaxis.set_major_locator(MaxNLocator(5, steps=STEPS))
    axes[0, 0].set_title("mean and band of one standard deviation")
    axes[0, 1].set_title("mean by the direction of the input")
    lines = [Line2D([], [], color=colour, lw=1.2, label=name) for name, colour, _ in _residuals(diagnosis)]
    figure.legend(handles=lines, loc="outside upper right", ncols=2)
    return finish(figure)


@house_style()
def draw_screening(diagnosis: Diagnosis) -> Figure:
    """Draw the score of each screened effect, and the fraction of the misfit that it explains."""
    shown = diagnosis.candidates[:_MAX_EFFECTS][::-1]
    colour_of = {
        (finding.name, finding.place): SIMULATED if finding.is_claimed else BAND
        for finding in diagnosis.effects
    }
    figure = blank(1.2 + 0.26 * len(shown), "Screened effects, each added alone to the calibrated simulation")
    axes = figure.subplots()
    places, gains = np.arange(len(shown)), [candidate.score for candidate in shown]
    colours = [colour_of.get((candidate.name, candidate.place), FRAME) for candidate in shown]
    axes.barh(places, gains, color=colours, height=0.7)
    placed = [f"{each.name}:{each.place}" if each.place else each.name for each in shown]
    names = [get_title(each) or each for each in placed]
    axes.set_yticks(places, names)
    axes.axvline(0.0, color=FRAME, lw=0.6)
    for place, candidate in zip(places, shown, strict=True):
        axes.annotate(
            f"{floor(100 * candidate.explained_fraction)} %",
            (max(candidate.score, 0.0), float(place)),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
        )
    axes.margins(x=0.12)
    axes.set_xlim(left=1.05 * min(0.0, *gains))
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("score (decrease of the BIC)\nper cent: share of the misfit above the noise floor")
    handles = [
        Patch(color=colour, label=text)
        for colour, text in ((SIMULATED, "claimed"), (BAND, "in the extended simulation, not claimed"))
        if colour in colours
    ]
    if handles:
        axes.legend(handles=handles, loc="lower right")
    return finish(figure)


def _input_label(diagnosis: Diagnosis) -> str:
    return label(diagnosis.record.input_names[0], diagnosis.record.input_units[0])


def _outputs(diagnosis: Diagnosis) -> list[tuple[str, str, Signal]]:
    """Return name, colour and values of each simulated output."""
    outputs = diagnosis.simulated_outputs
    return [
        (name, colour, output)
        for (name, output), colour in zip(outputs.items(), (BEFORE, SIMULATED), strict=False)
    ]


def _residuals(diagnosis: Diagnosis) -> list[tuple[str, str, Signal]]:
    """Return name, colour and values of the residual of each simulated output."""
    return [(name, colour, diagnosis.record.y - output) for name, colour, output in _outputs(diagnosis)]


def _name_part(record: Dataset, part: slice) -> str:
    """Name a part of a record in a title."""
    if part == slice(0, record.samples):
        return "whole record"
    begin, end = record.time[part.start], record.time[part.stop - 1]
    return f"{begin:.4g} s to {end:.4g} s"


def _draw_input(axes: Axes, record: Dataset, part: slice) -> None:
    """Draw the first input; lines are interrupted between recordings."""
    shown = record[part]
    line = downsample(break_line(shown, shown.time), break_line(shown, shown.u[:, 0]))
    axes.plot(*line, color=RESIDUAL, lw=SIMULATED_WIDTH)
    axes.set_xlim(float(shown.time[0]), float(shown.time[-1]))
    axes.set_ylabel(label(record.input_names[0], record.input_units[0]))
    axes.yaxis.set_major_locator(MaxNLocator(3, steps=STEPS))


def _draw_over_time_panels(
    above: Axes, below: Axes, diagnosis: Diagnosis, part: slice, weight: float = 1.0
) -> None:
    """Draw a part of the record; lines are interrupted between recordings, and thin lines separate these."""
    record, shown = diagnosis.record, diagnosis.record[part]
    time, broken_time = shown.time, break_line(shown, shown.time)
    vertices = VERTICES if weight == 1.0 else _OVERVIEW_VERTICES
    measured = downsample(broken_time, break_line(shown, shown.y), vertices)
    above.plot(*measured, color=MEASURED, lw=weight * MEASURED_WIDTH, label="measured")
    for panel, lines in ((above, _outputs(diagnosis)), (below, _residuals(diagnosis))):
        for name, colour, line in lines:
            drawn = downsample(broken_time, break_line(shown, line[part]), vertices)
            panel.plot(*drawn, color=colour, lw=weight * SIMULATED_WIDTH, label=name)
        first = max(float(record.time[diagnosis.estimation_samples]), float(time[0]))
        if first < time[-1]:
            panel.axvspan(first, float(time[-1]), facecolor=SHADE, edgecolor="none", zorder=0.5)
        for _, end in shown.bounds[:-1]:
            panel.axvline(time[end] - record.dt / 2, color=FRAME, lw=0.6)
        panel.set_xlim(float(time[0]), float(time[-1]))
        panel.yaxis.set_major_locator(MaxNLocator(5, steps=STEPS))
    above.tick_params(labelbottom=False)
    above.set_ylabel(label(record.output_name, record.output_unit))
    below.set_ylabel(label("residual", record.output_unit))


def draw_cells(axes: Axes, signal: Signal, residuals: Sequence[tuple[str, str, Signal]]) -> None:
    """Draw mean and standard deviation of residuals over a signal.

    Parameters
    ----------
    residuals : sequence of (str, str, ndarray)
        Name, colour and values of each residual, NaN where the output is unknown.
    """
    is_known = ~np.isnan(residuals[0][2])
    middle, cell, count = _sort_into_cells(signal[is_known])
    for name, colour, residual in residuals:
        mean, square = (np.bincount(cell, weights=residual[is_known] ** p) / count for p in (1, 2))
        spread = np.sqrt(np.maximum(square - mean**2, 0.0))
        axes.fill_between(middle, mean - spread, mean + spread, color=colour, alpha=0.25, lw=0)
        axes.plot(middle, mean, color=colour, lw=1.2, label=name)
    axes.axhline(0.0, color=FRAME, lw=0.6, zorder=1)


def _draw_directions(axes: Axes, u: Signal, rate: Signal, diagnosis: Diagnosis) -> None:
    """Draw the mean while the input rises and while it falls; a difference indicates hysteresis."""
    for way, rises, line in (("rising", True, "-"), ("falling", False, (0, (3, 1.5)))):
        chosen = ((rate > 0.0) == rises) & ~np.isnan(diagnosis.record.y)
        if not chosen.any():
            continue
        middle, cell, count = _sort_into_cells(u[chosen])
        for _, colour, residual in _residuals(diagnosis):
            mean = np.bincount(cell, weights=residual[chosen]) / count
            axes.plot(middle, mean, color=colour, lw=1.2, ls=line)
        axes.plot([], [], color=FRAME, lw=1.2, ls=line, label=way)
    axes.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
    axes.set(xlabel=_input_label(diagnosis), ylabel=label("residual", diagnosis.record.output_unit))
    axes.legend(loc="best", ncols=2)


def _sort_into_cells(signal: Signal) -> tuple[Signal, NDArray[np.int64], NDArray[np.int64]]:
    """Sort samples into cells; return the mean of each cell, the cell of each sample, and the counts.

    A signal with few levels has fewer cells, so that no cell is empty.
    """
    edges = np.unique(np.quantile(signal, np.linspace(0.0, 1.0, _CELLS + 1)[1:-1]))
    _, cell = np.unique(np.searchsorted(edges, signal, side="right"), return_inverse=True)
    count = np.bincount(cell)
    return np.bincount(cell, weights=signal) / count, cell, count


def _draw_spectrum(axes: Axes, diagnosis: Diagnosis) -> None:
    """Draw Welch's amplitude spectral densities of the residuals, whose gaps are interpolated.

    Windows are a quarter of the longest recording; shorter recordings are left out.
    """
    record = diagnosis.record
    window = max(16, max(record.segments) // _WINDOWS)
    bounds = [(begin, end) for begin, end in record.bounds if end - begin >= window] or record.bounds
    for _, colour, residual in _residuals(diagnosis):
        parts = [fill_gaps(residual)[slice(*each)] for each in bounds]
        found = [estimate_spectrum(part, record.dt, window, centres_parts=True) for part in parts]
        frequency = found[0][0]
        density = np.average(
            [each for _, each in found], axis=0, weights=[end - begin for begin, end in bounds]
        )
        axes.plot(frequency[1:], np.sqrt(density[1:]), color=colour, lw=1.0)
    axes.set(xscale="log", yscale="log", xlabel="frequency (Hz)")
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        # Label minor ticks, too, if powers of ten give at most one label.
        if high < 100.0 * low:
            subs = (2.0, 5.0) if high > 10.0 * low else (2.0, 3.0, 5.0, 7.0)
            axis.set_minor_locator(LogLocator(subs=subs))
            axis.set_minor_formatter(StrMethodFormatter("{x:g}"))
    axes.set_ylabel(f"amplitude density ({record.output_unit or '1'}/√Hz)")


def _draw_autocorrelation(axes: Axes, diagnosis: Diagnosis) -> None:
    for name, colour, residual in _residuals(diagnosis):
        centred = np.nan_to_num(residual - np.nanmean(residual))
        parts = [centred[begin:end] for begin, end in diagnosis.record.bounds]
        lags = np.arange(1, min(_LAGS, max(diagnosis.record.segments) - 1) + 1)
        correlation = [
            sum(float(part[lag:] @ part[:-lag]) for part in parts) / float(centred @ centred) for lag in lags
        ]
        axes.plot(diagnosis.record.dt * lags, correlation, color=colour, lw=1.2, label=name)
    bound = 1.96 / np.sqrt(np.count_nonzero(~np.isnan(diagnosis.record.y)))
    axes.axhspan(-bound, bound, color=SHADE, zorder=0.5)
    axes.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
    axes.set(xlabel="lag (s); shaded: white noise", ylabel="autocorrelation")


#: Figures by name, in the order of a report.
DIAGNOSIS_FIGURES: Mapping[str, Callable[[Diagnosis], Figure]] = MappingProxyType(
    {"over-time": draw_over_time, "loops": draw_loops, "residual": draw_residual, "ladder": draw_screening}
)


@house_style()
def draw_free_forms(diagnosis: Diagnosis) -> Figure:
    """Draw the coefficients of each free form with their 95 % intervals, one panel for each form."""
    forms = list_free_forms(diagnosis.effects)
    figure = blank(0.4 + 2.4 * len(forms), "Free forms: values with 95 % intervals")
    panels = figure.subplots(len(forms), 1, squeeze=False)[:, 0]
    for axes, form in zip(panels, forms, strict=True):
        values = list(form.parameters.values())
        middle = [each.value for each in values]
        bounds = [each.ci95 or (each.value, each.value) for each in values]
        errors = [
            [value - low for value, (low, _) in zip(middle, bounds, strict=True)],
            [high - value for value, (_, high) in zip(middle, bounds, strict=True)],
        ]
        axes.errorbar(range(len(values)), middle, errors, color=SIMULATED, marker="o", ms=4, capsize=3)
        axes.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
        axes.set_xticks(range(len(values)), list(form.parameters))
        axes.set_ylabel(label(get_title(form.name) or form.name, values[0].unit))
    return finish(figure)


@house_style()
def draw_effect_shape(shape: EffectShape) -> Figure:
    """Draw the curve of an effect, and the values of the free curve with their 95 % intervals."""
    name, form = (get_title(each) or each for each in (shape.name, shape.form))
    figure = blank(2.8, f"Shape of the effect, without gain and offset: {name}")
    axes = figure.subplots()
    axes.plot(shape.places, shape.named, color=SIMULATED, label=name)
    axes.errorbar(
        shape.free_places,
        shape.free,
        shape.half_widths,
        color=MEASURED,
        ls="none",
        marker="o",
        ms=4,
        capsize=3,
        label=f"{form}, 95 % intervals",
    )
    axes.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
    axes.set_xlabel(label(shape.signal, shape.signal_unit))
    axes.set_ylabel(label("added", shape.unit))
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return finish(figure)


#: Points of the curve of the force.
_POINTS = 401


@house_style()
def draw_residual_over_rate(diagnosis: Diagnosis) -> Figure:
    """Draw the residual over the rate that an effect acts on, without the effect and with it, and its force.

    Without the effect, all other values are those of the extended simulation.

    Raises
    ------
    ValueError
        No claimed effect acts on a rate.
    """
    effect = find_rate_effect(diagnosis)
    if effect is None:
        raise ValueError("no claimed effect acts on a rate")
    record, context = diagnosis.record, diagnosis.best.simulation.context
    coordinate = context.force_coordinate
    signal = diagnosis.best.output if coordinate.is_output else context.u
    rate = map_segments(lambda part: np.gradient(part, record.dt), signal, record.segments)
    name = get_title(effect.name) or effect.name
    figure = blank(4.6, f"Residual over the rate that the effect acts on: {name}")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1.0))
    outputs = (
        (f"without {name}", BEFORE, _simulate_without(diagnosis, effect)),
        (f"with {name}", SIMULATED, diagnosis.best.output),
    )
    draw_cells(above, rate, [(text, colour, record.y - output) for text, colour, output in outputs])
    above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    above.set_ylabel(label("residual", record.output_unit))
    places = np.linspace(float(rate.min()), float(rate.max()), _POINTS)
    below.plot(places, _compute_force(diagnosis, effect, places), color=SIMULATED, lw=1.2)
    below.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
    moved, unit = record.input_names[0], record.input_units[0]
    if coordinate.is_output:
        moved, unit = record.output_name, record.output_unit
    below.set_xlabel(label(f"rate of {label(moved, unit).partition(' (')[0]}", f"{unit or '1'}/s"))
    below.set_ylabel(label("added", coordinate.force_unit))
    return finish(figure)


def _simulate_without(diagnosis: Diagnosis, effect: Effect) -> Signal:
    """Simulate the extended simulation with the nominal values of an effect, at which it vanishes."""
    fit = diagnosis.best
    values, part = fit.values.copy(), fit.simulation.get_slice(effect)
    values[part] = fit.simulation.nominal[part]
    return fit.simulation.simulate(values)


def _compute_force(diagnosis: Diagnosis, effect: Effect, places: Signal) -> Signal:
    """Return the force of an effect at each rate."""
    fit, law = diagnosis.best, effect.form
    assert isinstance(law, ForceLaw)
    context = fit.simulation.context
    numbers = np.array([*fit.values[fit.simulation.get_slice(effect)], *law.constants(context)])
    return np.array([law.force(0.0, float(place), 0.0, numbers) for place in places])
