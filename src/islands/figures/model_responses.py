"""Response of a model to a step, and its static characteristic."""

from collections.abc import Sequence
from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from islands.data.channel_names import parse_unit
from islands.figures.style import MEASURED, SIMULATED, blank, finish, house_style, label
from islands.model.model import Model
from islands.simulation.step_response import StepResponse


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
    model: Model, inputs: Sequence[float], outputs: NDArray[np.float64], ax: Axes | None = None
) -> Figure:
    """Draw the output at rest over the input.

    Parameters
    ----------
    model : Model
        Model with one input.
    inputs : sequence of float
    outputs : ndarray, shape (points,)
    ax : Axes, optional
        Axes to draw into; by default those of a new figure.
    """
    figure = blank(3.4) if ax is None else cast("Figure", ax.get_figure(root=True))
    axes = figure.subplots() if ax is None else ax
    axes.plot(inputs, outputs, color=SIMULATED, lw=1.4, label="model")
    (name,) = model.column_names
    axes.set_xlabel(f"constant {label(name, parse_unit(name))}")
    axes.set_ylabel(f"{label(model.output_name, parse_unit(model.output_name))} at rest")
    return finish(figure) if ax is None else figure
