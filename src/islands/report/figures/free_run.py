"""Measured and simulated output over time, and the residual."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from islands.records.dataset import Dataset
from islands.report.figures.lines import (
    annotate_divergence,
    break_line,
    divergence,
    downsample,
    envelope,
    finite_part,
    limits,
    representative_window,
    within_reach,
)
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
from islands.validation.metrics import metrics
from islands.validation.prediction_bands import PredictionBand

#: Added to the title of a section without missing values.
_MEDIAN_SECTION = "; its mean absolute residual is the median of all sections"


@house_style()
def draw_free_run(
    record: Dataset, simulated: NDArray[np.float64], title: str = "", band: PredictionBand | None = None
) -> Figure:
    """Draw the measured output and the free run, and below them the residual on a separate scale.

    A record of more than 20 loops is shown completely and, below, in a section whose residual is the median
    of all sections. Thin vertical lines separate segments; missing values are gaps. The axis limits follow a
    diverging simulation up to one output range beyond the measured output, and the divergence is annotated.

    Parameters
    ----------
    record : Dataset
    simulated : ndarray, shape (samples,)
        Simulated output, in the unit of the output; NaN if there is no prediction.
    title : str
    band : PredictionBand, optional
        Shaded about the free run, and about zero below it.

    Returns
    -------
    Figure
        Two axes (output, residual); or four, with those of the section below those of the record.

    Raises
    ------
    SettingsError
        The simulation does not have one value per sample.
    """
    yhat = finite_part(record, simulated)
    half = None if band is None else 0.5 * (band.upper - band.lower)
    section = representative_window(record, record.y - yhat)
    if section is None:
        figure = blank(4.2, title)
        axes = figure.subplots(2, 1, height_ratios=(2, 1))
        _draw_pair(axes[0], axes[1], record, yhat, half, 1.0)
    else:
        figure = blank(7.2, title)
        axes = figure.subplots(4, 1, height_ratios=(2, 1, 2.4, 1.2))
        _draw_pair(axes[0], axes[1], record, yhat, half, 0.6)
        _draw_pair(
            axes[2], axes[3], record[section], yhat[section], None if half is None else half[section], 1.0
        )
        _mark_section(axes[:2], record[section])
        complete = not np.isnan((record.y - yhat)[section]).any()
        axes[2].set_title("shaded section" + (_MEDIAN_SECTION if complete else ""), fontsize=8.0)
    if np.isnan(yhat).all():
        axes[0].set_title("no simulated value", color=SIMULATED)
    handles, labels = axes[0].get_legend_handles_labels()
    if band is not None:
        handles.append(Patch(color=BAND))
        labels.append(f"{100 * band.level:g} % band")
    axes[0].legend(handles, labels, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)
    axes[1].set_title(_format_errors(record, yhat), loc="right", fontsize=8.0)
    figure.align_ylabels()
    return finish(figure)


@house_style()
def draw_free_runs(records: Sequence[Dataset], simulated: Sequence[NDArray[np.float64]]) -> Figure:
    """Draw the measured output and the free run of several outputs, one below the other.

    Parameters
    ----------
    records : sequence of Dataset
        Record of each output.
    simulated : sequence of ndarray
        Simulation of each output, of shape (samples,).
    """
    figure = blank(0.6 + 2.0 * len(records))
    panels = figure.subplots(len(records), sharex=True, squeeze=False)[:, 0]
    for axes, record, run in zip(panels, records, simulated, strict=True):
        draw_free_run_panel(axes, record, run)
        axes.label_outer()
    return finish(figure)


def draw_free_run_panel(axes: Axes, record: Dataset, simulated: NDArray[np.float64]) -> None:
    """Draw the measured output and the free run into axes, without the residual.

    Parameters
    ----------
    axes : Axes
        Axes of the user; their style is kept.
    record, simulated
        As in `draw_free_run`.

    Raises
    ------
    SettingsError
        The simulation does not have one value per sample.
    """
    yhat = finite_part(record, simulated)
    _draw_outputs(axes, record, yhat, 1.0)
    axes.set_xlabel("time (s)")
    axes.legend()


def _draw_pair(
    above: Axes,
    below: Axes,
    record: Dataset,
    yhat: NDArray[np.float64],
    half: NDArray[np.float64] | None,
    weight: float,
) -> None:
    time = break_line(record, record.time)
    measured = break_line(record, record.y)
    residual = measured - break_line(record, yhat)
    followed = break_line(record, _clip_diverged(record, yhat))
    _draw_outputs(above, record, yhat, weight)
    below.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
    below.plot(*downsample(time, residual), color=RESIDUAL, lw=weight * SIMULATED_WIDTH, label="residual")
    below.set_ylim(limits(measured - followed, np.zeros(1)))
    if half is not None:
        _draw_band(above, record, yhat, half)
        _draw_band(below, record, np.zeros(record.samples), half)
    below.yaxis.set_major_locator(MaxNLocator(4, steps=STEPS))
    for axes in (above, below):
        axes.set_xlim(record.time[0], record.time[-1] + (record.dt if record.samples == 1 else 0.0))
        for _, end in record.bounds[:-1]:
            axes.axvline(record.time[end] - record.dt / 2, color=FRAME, lw=0.6)
    above.tick_params(labelbottom=False)
    below.set(xlabel="time (s)", ylabel=label("residual", record.output_unit))
    _annotate_divergences(above, record, yhat)


def _draw_outputs(axes: Axes, record: Dataset, yhat: NDArray[np.float64], weight: float) -> None:
    time = break_line(record, record.time)
    measured, simulated = break_line(record, record.y), break_line(record, yhat)
    axes.plot(*downsample(time, measured), color=MEASURED, lw=weight * MEASURED_WIDTH, label="measured")
    axes.plot(*downsample(time, simulated), color=SIMULATED, lw=weight * SIMULATED_WIDTH, label="simulated")
    axes.set_ylim(limits(measured, break_line(record, _clip_diverged(record, yhat))))
    axes.set_ylabel(label(record.output_name, record.output_unit))


def _draw_band(axes: Axes, record: Dataset, centre: NDArray[np.float64], half: NDArray[np.float64]) -> None:
    """Shade a band within the limits of the axes, which it does not change."""
    low, high = axes.get_ylim()
    margin = high - low
    # An infinite limit is drawn beyond the axes; NaN remains a gap.
    inside = np.clip([centre - half, centre + half], low - margin, high + margin)
    at, lower, upper = envelope(
        break_line(record, record.time), break_line(record, inside[0]), break_line(record, inside[1])
    )
    axes.fill_between(at, lower, upper, color=BAND, lw=0.0, zorder=0.8)
    axes.set_ylim(low, high)


def _clip_diverged(record: Dataset, yhat: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the simulation with diverging segments clipped, for axis limits."""
    followed = yhat.copy()
    for segment, _ in divergence(record, yhat):
        followed[segment] = within_reach(record, yhat[segment])
    return followed


def _annotate_divergences(axes: Axes, record: Dataset, yhat: NDArray[np.float64]) -> None:
    lines = []
    for segment, last in divergence(record, yhat):
        known = segment.start + np.flatnonzero(~np.isnan(yhat[segment.start : last + 1]))
        lines.append((record.time[known], yhat[known]))
    annotate_divergence(axes, lines)


def _mark_section(whole: NDArray[np.object_], section: Dataset) -> None:
    for axes in whole:
        axes.axvspan(section.time[0], section.time[-1], facecolor=SHADE, edgecolor=FRAME, lw=0.6, zorder=0.5)


def _format_errors(record: Dataset, yhat: NDArray[np.float64]) -> str:
    """Return the errors of the record as text; empty if the simulation diverged."""
    errors = metrics(record.y, yhat)
    if divergence(record, yhat) or np.isnan(errors.mape):
        return ""
    mape, rmse = (f"{value:#.3g}".removesuffix(".") for value in (errors.mape, errors.rmse))
    return f"MAPE {mape} % of the range, RMSE {rmse} {record.output_unit}".rstrip()
