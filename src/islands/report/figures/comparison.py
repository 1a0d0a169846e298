"""Free runs of several models over the same measured output, and their residuals."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from islands.report.figures.lines import downsample
from islands.report.figures.style import (
    FRAME,
    MEASURED,
    MEASURED_WIDTH,
    RESIDUAL,
    SIMULATED,
    STEPS,
    blank,
    finish,
    house_style,
    label,
)

#: Colours and dashes of the models, which stay distinct in grey print and in a dark page.
RUN_STYLES = (
    (SIMULATED, "-"),
    (RESIDUAL, "-"),
    ("#00805c", "-"),
    ("#b0438f", "--"),
    ("#7a5c00", "--"),
    ("#4a4fb5", "--"),
)

#: Heights of the figure in inches, with residuals and without.
_HEIGHT, _LOW = 4.4, 2.5

#: Part of the output range by which the axis of outputs exceeds it, beyond which a free run is cut.
_MARGIN = 0.25


@house_style()
def draw_comparison(
    time: NDArray[np.float64],
    measured: NDArray[np.float64],
    runs: Mapping[str, NDArray[np.float64]],
    output: tuple[str, str],
    styles: Mapping[str, tuple[str, str]],
    residuals: bool = True,
) -> Figure:
    """Draw the measured output and the free runs of models, and their residuals below.

    Parameters
    ----------
    time, measured : ndarray, shape (samples,)
        Time in seconds; a missing output is NaN.
    runs : mapping of str to ndarray, shape (samples,)
        Free runs by the name of the model; NaN from a divergence on.
    output : (str, str)
        Name and unit of the output.
    styles : mapping of str to (str, str)
        Colour and dashes by the name of the model, of `RUN_STYLES`.
    residuals : bool
        Whether there is a panel with the residuals.
    """
    figure = blank(_HEIGHT if residuals else _LOW)
    panels = figure.subplots(2, 1, height_ratios=(2, 1.1), sharex=True) if residuals else [figure.subplots()]
    above = panels[0]
    above.plot(*downsample(time, measured), color=MEASURED, lw=MEASURED_WIDTH, label="measured")
    for name, run in runs.items():
        _draw(above, time, run, styles[name], name)
    _limit(above, measured)
    above.set_ylabel(label(*output))
    above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=7, borderaxespad=0.2)
    if residuals:
        below = panels[1]
        below.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
        for name, run in runs.items():
            _draw(below, time, measured - run, styles[name], name)
        below.yaxis.set_major_locator(MaxNLocator(4, steps=STEPS))
        below.set_ylabel(label("residual", output[1]))
    panels[-1].set_xlabel("time (s)")
    panels[-1].set_xlim(time[0], time[-1] if time.size > 1 else time[0] + 1.0)
    figure.align_ylabels()
    return finish(figure)


def _draw(
    axes: Axes, time: NDArray[np.float64], values: NDArray[np.float64], style: tuple[str, str], name: str
) -> None:
    colour, dashes = style
    axes.plot(*downsample(time, values), color=colour, ls=dashes, lw=0.9, label=name)


def _limit(axes: Axes, measured: NDArray[np.float64]) -> None:
    """Cut the axis of outputs where a diverging free run leaves the range of the measured output."""
    known = measured[np.isfinite(measured)]
    if known.size and (margin := _MARGIN * float(np.ptp(known))) > 0.0:
        low, high = axes.get_ylim()
        axes.set_ylim(max(low, known.min() - margin), min(high, known.max() + margin))
