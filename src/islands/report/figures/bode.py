"""Bode plot of a latent model, linearised about rest at its operating point."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from islands.models.latent import LatentModel
from islands.models.linear_system import find_resonances
from islands.records.dataset import Dataset
from islands.report.figures.style import (
    FRAME,
    REMARK,
    blank,
    finish,
    house_style,
    label,
    set_log_scale,
    write_plain_numbers,
)

#: Colours of the inputs, with a contrast of 3 in both colour schemes, and their line styles.
_COLOURS = ("#d55e00", "#0072b2", "#009e73", "#8c6bb1", "#3a3a3a", "#a68c00")
_STYLES = ("-", "--", "-.", ":")

#: Points of a line; lowest frequency relative to the slowest mode, and to the Nyquist frequency at least and
#: at most.
_POINTS, _BELOW, _LEAST, _MOST = 600, 0.1, 1e-5, 0.03

#: Distance from the ends of the axis, as a fraction, below which a mark is written inwards.
_NEAR = 0.2


@house_style()
def draw_bode(model: LatentModel, record: Dataset) -> Figure:
    """Draw magnitude and phase of the linear part at rest, from every input to the output.

    The frequencies end at the Nyquist frequency. Resonances are marked with their damping ratio.

    Parameters
    ----------
    model : LatentModel
    record : Dataset
        Record with the columns of the model, which gives their units.

    Returns
    -------
    Figure
        Two axes. A line per input; none of an input without an effect.
    """
    system, dt = model.linearise(model.rest), model.dt or 1.0
    frequencies = _list_frequencies(system.poles, dt)
    figure = blank(4.2, f"linear part about {model.operating_point}")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.3, 1))
    set_log_scale(above)
    above.set_xscale("log")
    write_plain_numbers(below.xaxis)
    output = label(model.output_name, record.output_unit)
    for place, response in enumerate(system.respond(frequencies * dt)):
        name = f"{output} over {label(model.column_names[place], record.input_units[place])}"
        if not response.any():
            above.plot([], [], color=FRAME, label=f"{name}: no effect")
            continue
        style = {"color": _COLOURS[place % len(_COLOURS)], "ls": _STYLES[place % len(_STYLES)], "lw": 1.4}
        above.plot(frequencies, np.abs(response), label=name, **style)
        below.plot(frequencies, np.degrees(np.unwrap(np.angle(response))), label=name, **style)
    below.set_xlim(frequencies[0], frequencies[-1])
    hertz = "cycles per sample" if model.dt is None else "Hz"
    _mark_resonances(above, below, find_resonances(system.poles, dt), hertz)
    units = {(record.output_unit, unit) for unit in record.input_units}
    above.set_ylabel(f"magnitude ({'/'.join(units.pop())})" if _have_one_quotient(units) else "magnitude")
    above.legend(loc="best")
    below.set_ylabel("phase (degrees)")
    below.yaxis.set_major_locator(MaxNLocator(steps=[1, 1.5, 3, 4.5, 9, 10], nbins=6))
    below.set_xlabel(f"frequency ({hertz})")
    figure.align_ylabels()
    return finish(figure)


def _have_one_quotient(units: set[tuple[str, str]]) -> bool:
    return len(units) == 1 and all(map(all, units))


def _list_frequencies(poles: NDArray[np.complex128], dt: float) -> NDArray[np.float64]:
    """Return frequencies from below the slowest mode to the Nyquist frequency, those of resonances too."""
    nyquist = 0.5 / dt
    moving = poles[(np.abs(poles) > 0.0) & (poles != 1.0)]
    rates = np.abs(np.log(moving)) / (2.0 * np.pi * dt)
    slowest = float(rates.min()) if rates.size else nyquist
    first = min(max(_BELOW * slowest, _LEAST * nyquist), _MOST * nyquist)
    resonances = [frequency for frequency, _ in find_resonances(poles, dt) if first < frequency < nyquist]
    spaced = np.geomspace(first, nyquist, _POINTS)
    spaced[-1] = nyquist
    return np.unique(np.concatenate([spaced, resonances]))


def _mark_resonances(above: Axes, below: Axes, resonances: Sequence[tuple[float, float]], hertz: str) -> None:
    """Mark the frequencies of resonances in both axes, with their damping ratios above."""
    first, last = np.log(above.get_xlim())
    for row, (frequency, damping) in enumerate(resonances):
        place = float((np.log(frequency) - first) / (last - first))
        for axes in (above, below):
            axes.axvline(frequency, color=FRAME, lw=0.8, ls=":")
        above.annotate(
            f"{frequency:.4g} {hertz}, damping ratio {damping:.3g}",
            (frequency, 1.0),
            xytext=(0, 4 + 10 * row),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            ha="left" if place < _NEAR else "right" if place > 1.0 - _NEAR else "center",
            fontsize=REMARK,
            annotation_clip=False,
        )
