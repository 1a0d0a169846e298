"""Curve of a static model: the output over every input, with the measured samples."""

from collections.abc import Sequence
from dataclasses import replace
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from islands.errors import ModelError
from islands.models.form import is_static
from islands.models.protocol import DynamicModel
from islands.records.channel_names import parse_channel_name
from islands.records.compatibility import match_record
from islands.records.dataset import Dataset
from islands.records.signal_map import match_rate
from islands.report.figures.lines import VERTICES
from islands.report.figures.style import (
    BAND,
    MEASURED,
    SIMULATED,
    SIMULATED_WIDTH,
    blank,
    finish,
    house_style,
    label,
)
from islands.simulation.initial_outputs import simulate_freely
from islands.validation.prediction_bands import PredictionBand, PredictionBands

#: Largest number of inputs in a row, and height of their panels in inches.
_COLUMNS, _HEIGHT = 2, 4.2

#: Points of a curve, and characters of a line of a title.
_POINTS, _CHARACTERS = 201, 50


@house_style()
def draw_static_curve(
    model: DynamicModel, records: Sequence[Dataset], warm_up: int = 0, bands: PredictionBands | None = None
) -> Figure:
    """Draw the output over each input, while the others have their median, and the residual below it.

    The distance of a sample from the curve is its residual: of several inputs, the model moves the sample to
    the medians of the others (a partial residual: Larsen & McCleary, Technometrics 14 (1972) 781-790).

    Parameters
    ----------
    model : DynamicModel
        Model whose output depends on inputs of the same sample only.
    records : sequence of Dataset
        Records with the inputs and the sampling time of the model. The first sample of a recording is not
        drawn, since no model predicts it.
    warm_up : int
        Number of samples before the first prediction of the models of the bands.
    bands : PredictionBands, optional
        Prediction bands of the model.

    Returns
    -------
    Figure
        Two axes for each input.

    Raises
    ------
    ModelError
        The model is not static.
    """
    if not is_static(model):
        raise ModelError("the figure static-curve is of static models: the output of this one has a past")
    data = [match_record(model, match_rate(model, each)) for each in records]
    u, residual = (
        np.concatenate(each) for each in zip(*(_list_samples(model, each) for each in data), strict=True)
    )
    medians = np.median(u, axis=0)
    drawn = slice(None, None, -(-len(u) // VERTICES))
    columns = min(model.inputs, _COLUMNS)
    rows = -(-model.inputs // columns)
    figure = blank(0.4 + _HEIGHT * rows)
    panels = figure.subplots(2 * rows, columns, squeeze=False, height_ratios=(2, 1) * rows)
    pairs = panels.reshape(rows, 2, columns).swapaxes(1, 2).reshape(-1, 2)
    for channel, (above, below) in enumerate(pairs[: model.inputs]):
        x, at = np.linspace(u[:, channel].min(), u[:, channel].max(), _POINTS), u[drawn, channel]
        curve = _predict(model, data[0], _set(medians, channel, x), warm_up, bands)
        moved = _predict(model, data[0], _set(medians, channel, at), warm_up).y + residual[drawn]
        for axes, values, line in ((above, moved, curve.y), (below, residual[drawn], np.zeros_like(x))):
            axes.plot(at, values, ".", color=MEASURED, ms=3.0, mew=0.0, label="measured")
            axes.plot(x, line, color=SIMULATED, lw=SIMULATED_WIDTH, label="model")
            _draw_band(axes, x, line, curve)
        below.sharex(above)
        above.tick_params(labelbottom=False)
        above.set_title(_describe_others(data[0], medians, channel), fontsize=8.0)
        name = parse_channel_name(model.input_names[channel]).base
        below.set_xlabel(label(name, data[0].input_units[channel]))
        if channel % columns == 0:
            above.set_ylabel(label(model.output_name, data[0].output_unit))
            below.set_ylabel(label("measured − model", data[0].output_unit))
    for axes in pairs[model.inputs :].flat:
        axes.remove()
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.align_ylabels()
    return finish(figure)


def _draw_band(axes: Axes, x: NDArray[np.float64], line: NDArray[np.float64], curve: PredictionBand) -> None:
    """Draw the band of a curve about a line where it is finite."""
    half = 0.5 * (curve.upper - curve.lower)
    if np.isfinite(half).any():
        half = np.where(np.isfinite(half), half, np.nan)
        name = f"{100 * curve.level:g} % band"
        axes.fill_between(x, line - half, line + half, color=BAND, lw=0.0, zorder=0.5, label=name)


def _list_samples(model: DynamicModel, record: Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the inputs and the residuals of the samples of a record."""
    # The input of a sample stands before it, as every input that a model reads.
    known = np.concatenate([np.arange(begin + 1, end) for begin, end in record.bounds])
    return record.u[known - 1], (record.y - simulate_freely(model, record).y)[known]


def _set(medians: NDArray[np.float64], channel: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return inputs of which one varies."""
    points = np.tile(medians, (len(x), 1))
    points[:, channel] = x
    return points


def _predict(
    model: DynamicModel,
    record: Dataset,
    points: NDArray[np.float64],
    warm_up: int,
    bands: PredictionBands | None = None,
) -> PredictionBand:
    """Return the output at inputs, with its band; the record has names, range and sampling time."""
    lead = max(warm_up, model.maximum_lag, 1)
    # The input of a sample stands before it. Members of the ensemble may have a past, and rest at first.
    u = np.vstack([*[points[:1]] * (lead - 1), points, points[-1:]])
    # The range of the output decides what a divergence is.
    y = np.resize([np.nanmin(record.y), np.nanmax(record.y)], len(u))
    held = Dataset(u, y, record.dt, record.input_names, record.output_name)
    run = simulate_freely(model, held, lead).y
    if bands is None:
        return PredictionBand(np.nan, run[lead:], *[np.full(len(points), np.nan)] * 2)
    found = bands.predict(
        model, replace(held, y=np.where(np.arange(len(u)) < lead, run[lead], run)), warm_up=lead
    )
    return replace(found, y=found.y[lead:], lower=found.lower[lead:], upper=found.upper[lead:])


def _describe_others(record: Dataset, medians: NDArray[np.float64], channel: int) -> str:
    """State the medians of the inputs other than one, to which the samples are moved."""
    others = [
        f"{parse_channel_name(name).base} = {f'{value:.4g}'.replace('-', '−')} {unit}".rstrip()
        for place, (name, value, unit) in enumerate(
            zip(record.input_names, medians.tolist(), record.input_units, strict=True)
        )
        if place != channel
    ]
    return fill(f"samples moved to the median of {', '.join(others)}" if others else "", _CHARACTERS)
