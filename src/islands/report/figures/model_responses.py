"""Response of a model to a step, and its static characteristic."""

from collections.abc import Sequence
from contextlib import suppress
from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from islands.errors import ModelError
from islands.models.form import is_static
from islands.models.operating_point import static_characteristic
from islands.models.protocol import DynamicModel
from islands.records.channel_names import parse_unit
from islands.records.dataset import Dataset
from islands.report.figures.style import MEASURED, SIMULATED, blank, finish, house_style, label
from islands.simulation.input_response import StepResponse, step_response

#: Points of a characteristic; the equilibria of models with functions such as roots are searched.
POINTS = 25


@house_style()
def draw_step_response(response: StepResponse, ax: Axes | None = None) -> Figure:
    """Draw the output and, above it in a new figure, the input that steps.

    Parameters
    ----------
    response : StepResponse
    ax : Axes, optional
        Axes for the output; the input is then not drawn.
    """
    if ax is not None:
        _draw_output(ax, response)
        return cast("Figure", ax.get_figure(root=True))
    figure = blank(3.4)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1, 2.4))
    above.step(response.time, response.u, where="post", color=MEASURED, lw=1.4)
    above.set_ylabel(label(response.input_name, parse_unit(response.input_name)))
    above.margins(y=0.15)
    _draw_output(below, response)
    figure.align_ylabels()
    return finish(figure)


def _draw_output(axes: Axes, response: StepResponse) -> None:
    axes.plot(response.time, response.y, color=SIMULATED, lw=1.4, label=response.output_name)
    axes.set_xlim(response.time[0], response.time[-1])
    axes.set_xlabel("time after the step (s)")
    axes.set_ylabel(label(response.output_name, parse_unit(response.output_name)))


@house_style()
def draw_static_characteristic(
    model: DynamicModel,
    inputs: Sequence[float] | NDArray[np.float64],
    outputs: NDArray[np.float64],
    ax: Axes | None = None,
    channel: int = 0,
) -> Figure:
    """Draw the output at rest over one input.

    Parameters
    ----------
    model : DynamicModel
    inputs : sequence of float
    outputs : ndarray, shape (points,)
    ax : Axes, optional
        Axes to draw into; by default those of a new figure.
    channel : int
        Number of the input, from 0.
    """
    figure = blank(3.4) if ax is None else cast("Figure", ax.get_figure(root=True))
    axes = figure.subplots() if ax is None else ax
    axes.plot(inputs, outputs, color=SIMULATED, lw=1.4, label="model")
    name = model.column_names[channel]
    axes.set_xlabel(f"constant {label(name, parse_unit(name))}")
    axes.set_ylabel(f"{label(model.output_name, parse_unit(model.output_name))} at rest")
    return finish(figure) if ax is None else figure


def draw_responses(model: DynamicModel, record: Dataset) -> dict[str, Figure]:
    """Draw the static characteristic and the step response of a model within the range of a record.

    The first input that varies steps from the lower to the upper quartile; other inputs have their mean.

    Returns
    -------
    dict
        ``characteristic`` and ``step-response``; a figure whose equilibria are not unique or not stable, as
        of models of hysteresis, is left out. A static model has none: see `draw_static_curve`.
    """
    varying = np.flatnonzero(np.ptp(record.u, axis=0))
    if not varying.size or is_static(model):
        return {}
    channel = int(varying[0])
    signal = record.u[:, channel]
    figures = {}
    with suppress(ModelError):
        points = np.tile(record.u.mean(axis=0), (POINTS, 1))
        points[:, channel] = np.linspace(signal.min(), signal.max(), POINTS)
        outputs = static_characteristic(model, points)
        figures["characteristic"] = draw_static_characteristic(
            model, points[:, channel], outputs, channel=channel
        )
    with suppress(ModelError):
        start, end = record.u.mean(axis=0), record.u.mean(axis=0)
        start[channel], end[channel] = np.quantile(signal, [0.25, 0.75])
        if start[channel] != end[channel]:
            figures["step-response"] = draw_step_response(step_response(model, start, end))
    return figures
