"""Figures of a linear system: Bode plot, Nyquist plot, pole map and responses to unit steps."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from islands.errors import ModelError, lookup
from islands.models.state_space import StateSpace, find_resonances
from islands.records.envelope import find_envelope
from islands.report.figures.lines import VERTICES, downsample
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

#: Distance from the ends of the axis, as a fraction, below which a mark is written inwards.
_NEAR = 0.2

#: Height of the text of a resonance in inches.
_ROW = 10.0 / 72.0

#: Opacity of bands and members.
_SHADE = 0.25

#: Largest magnitude of a drawn zero relative to the poles and the limit of stability: that of a sampled
#: system may be any number, and leave no room for them.
_FAR = 2.0

#: Largest magnitude of a Nyquist plot relative to the distance 1 of the critical point; the rest of an
#: integrator is cut off.
_LARGEST = 10.0


def draw_linear_system(system: StateSpace, kind: str = "bode") -> Figure:
    """Draw a figure of a linear system; ``kind`` is a key of `LINEAR_FIGURES`.

    Raises
    ------
    ModelError
        The system is static.
    SettingsError
        There is no such figure.
    """
    draw = lookup(LINEAR_FIGURES, kind, "figure")
    if system.is_static:
        raise ModelError(
            f"a static model has no figure {kind}: its gain is that of all frequencies; take the figure "
            "static-curve"
        )
    return draw(system)


@house_style()
def draw_bode(system: StateSpace) -> Figure:
    """Draw magnitude and phase from every input to every output, with 90 % bands if they are known.

    The frequencies of a discrete system end at the Nyquist frequency. Resonances are marked with their
    damping ratio.

    Parameters
    ----------
    system : StateSpace

    Returns
    -------
    Figure
        Two axes for each output. A line for each input; none of an input without an effect.
    """
    response = system.frequency_response()
    frequencies, hertz = response.points, _name_frequencies(system)
    marks = _list_marks(find_resonances(system.poles, system.step), hertz)
    outputs = len(system.D)
    figure = blank(0.4 + 3.6 * outputs + _ROW * len(marks), _write_title(system, has_bands=True))
    panels = figure.subplots(2 * outputs, 1, sharex=True, height_ratios=(1.3, 1) * outputs, squeeze=False)
    banded = len(response.members) > 1
    if banded:
        # The phases of the members differ from that of the system by less than a turn.
        relative = response.members / np.where(response.values == 0.0, 1.0, response.values)
        magnitudes = response.band()
        shifts = [np.degrees(each) for each in replace(response, members=relative).band(of=np.angle)]
    for output, (above, below) in enumerate(panels.reshape(outputs, 2)):
        set_log_scale(above)
        above.set_xscale("log")
        for place, (name, _, channel) in enumerate(_list_channels(system, output)):
            values, style = response.values[output, channel], _choose_style(place)
            if not values.any():
                above.plot([], [], color=FRAME, label=f"{name}: no effect")
                continue
            phase = np.degrees(np.unwrap(np.angle(values)))
            above.plot(frequencies, np.abs(values), label=name, **style)
            below.plot(frequencies, phase, label=name, **style)
            if banded:
                limits = [each[output, channel] for each in magnitudes]
                above.fill_between(frequencies, *limits, color=style["color"], alpha=_SHADE, lw=0)
                turned = [phase + each[output, channel] for each in shifts]
                below.fill_between(frequencies, *turned, color=style["color"], alpha=_SHADE, lw=0)
        units = {(unit, other) for unit in system.output_units[output:][:1] for other in system.input_units}
        above.set_ylabel(f"magnitude ({'/'.join(units.pop())})" if _have_one_quotient(units) else "magnitude")
        above.legend(loc="best")
        below.set_ylabel("phase (degrees)")
        below.yaxis.set_major_locator(MaxNLocator(steps=[1, 1.5, 3, 4.5, 9, 10], nbins=6))
    lowest = panels[-1, 0]
    write_plain_numbers(lowest.xaxis)
    lowest.set_xlim(frequencies[0], frequencies[-1])
    lowest.set_xlabel(f"frequency ({hertz})")
    _draw_marks(panels[:, 0].tolist(), marks)
    figure.align_ylabels()
    return finish(figure)


@house_style()
def draw_nyquist(system: StateSpace) -> Figure:
    """Draw the frequency response in the complex plane, with the critical point -1 and its members."""
    response = system.frequency_response()
    figure = blank(4.2, _write_title(system))
    axes = figure.subplots()
    for place, (name, output, channel) in enumerate(_list_channels(system)):
        style = _choose_style(place)
        for member in response.members[:, output, channel]:
            shown = _cut(member)
            axes.plot(shown.real, shown.imag, color=style["color"], alpha=_SHADE, lw=0.6)
        shown = _cut(response.values[output, channel])
        axes.plot(shown.real, shown.imag, label=name, **style)
    axes.plot(-1.0, 0.0, "+", color=FRAME, ms=9, label="critical point")
    axes.axhline(0.0, color=FRAME, lw=0.6)
    axes.axvline(0.0, color=FRAME, lw=0.6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("real part")
    axes.set_ylabel("imaginary part")
    axes.legend(loc="best")
    return finish(figure)


def _cut(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return a response without the points that would leave no room for the critical point."""
    finite = values[np.isfinite(values)]
    largest = _LARGEST * max(1.0, float(np.median(np.abs(finite))) if finite.size else 1.0)
    return np.where(np.abs(values) <= largest, values, np.nan)


@house_style()
def draw_pole_map(system: StateSpace) -> Figure:
    """Draw poles and zeros in the complex plane with the limit of stability, and the poles of the members."""
    figure = blank(4.2, _write_title(system))
    axes = figure.subplots()
    if system.is_continuous:
        axes.axvline(0.0, color=FRAME, lw=0.8, ls=":")
    else:
        turn = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 361))
        axes.plot(turn.real, turn.imag, color=FRAME, lw=0.8, ls=":")
    if system.members:
        poles = np.concatenate([each.poles for each in system.members])
        axes.plot(poles.real, poles.imag, ".", color=_COLOURS[1], alpha=_SHADE, label="poles of the ensemble")
    poles = system.poles
    axes.plot(poles.real, poles.imag, "x", color=_COLOURS[0], label="poles")
    zeros = system.zeros if system.D.shape[0] == system.D.shape[1] else np.empty(0)
    if zeros.size:
        stable = 0.0 if system.is_continuous else 1.0
        is_far = np.abs(zeros) > _FAR * max(stable, float(np.abs(poles).max(initial=0.0)))
        far = ", ".join(
            f"{zero.real:.3g}" + (f" \u00b1 {zero.imag:.3g}j" if zero.imag else "")
            for zero in zeros[is_far & (zeros.imag >= 0.0)]
        )
        name = f"zeros (outside: {far})" if far else "zeros"
        near = zeros[~is_far]
        axes.plot(near.real, near.imag, "o", mfc="none", color=_COLOURS[2], label=name)
    axes.axhline(0.0, color=FRAME, lw=0.6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("real part (1/s)" if system.is_continuous else "real part")
    axes.set_ylabel("imaginary part (1/s)" if system.is_continuous else "imaginary part")
    axes.legend(loc="best")
    return finish(figure)


@house_style()
def draw_unit_step(system: StateSpace) -> Figure:
    """Draw the responses to a unit step of every input, with 90 % bands if they are known."""
    response = system.step_response()
    outputs = len(system.D)
    figure = blank(0.4 + 3.0 * outputs, _write_title(system, has_bands=True))
    panels = figure.subplots(outputs, sharex=True, squeeze=False)[:, 0]
    for output, axes in enumerate(panels):
        for place, (name, _, channel) in enumerate(_list_channels(system, output)):
            style = _choose_style(place)
            line = downsample(response.points, response.values[output, channel])
            axes.step(*line, where="post", label=name, **style)
            if len(response.members) > 1:
                low, high = (each[output, channel] for each in response.band(of=np.real))
                least, _, first = find_envelope(low, VERTICES // 4)
                _, greatest, _ = find_envelope(high, VERTICES // 4)
                axes.fill_between(
                    *(response.points[first], least, greatest),
                    step="post",
                    color=style["color"],
                    alpha=_SHADE,
                    lw=0,
                )
        axes.set_ylabel("response to a unit step")
        axes.legend(loc="best")
    panels[-1].set_xlim(response.points[0], response.points[-1])
    panels[-1].set_xlabel("samples after the step" if system.dt is None else "time after the step (s)")
    return finish(figure)


#: Figures of a linear system by name.
LINEAR_FIGURES: Mapping[str, Callable[[StateSpace], Figure]] = MappingProxyType(
    {"bode": draw_bode, "nyquist": draw_nyquist, "pole-map": draw_pole_map, "unit-step": draw_unit_step}
)


def _write_title(system: StateSpace, has_bands: bool = False) -> str:
    bands = ", with 90 % bands" if has_bands and len(system.members) > 1 else ""
    return f"linear part about {system.describe_point()}{bands}"


def _list_channels(system: StateSpace, only: int | None = None) -> list[tuple[str, int, int]]:
    """Return the label, the output and the input of every transfer function, or of those of one output."""
    outputs, inputs = system.D.shape
    return [
        (
            " over ".join(
                (
                    _label_signal(system.output_names, system.output_units, output, "y"),
                    _label_signal(system.input_names, system.input_units, channel, "u"),
                )
            ),
            output,
            channel,
        )
        for output in (range(outputs) if only is None else [only])
        for channel in range(inputs)
    ]


def _label_signal(names: Sequence[str], units: Sequence[str], place: int, otherwise: str) -> str:
    return label(names[place], units[place] if units else "") if names else f"{otherwise}{place + 1}"


def _choose_style(place: int) -> dict[str, Any]:
    return {"color": _COLOURS[place % len(_COLOURS)], "ls": _STYLES[place % len(_STYLES)], "lw": 1.4}


def _name_frequencies(system: StateSpace) -> str:
    return "cycles per sample" if system.dt is None else "Hz"


def _have_one_quotient(units: set[tuple[str, str]]) -> bool:
    return len(units) == 1 and all(map(all, units))


def _list_marks(resonances: Sequence[tuple[float, float]], hertz: str) -> dict[str, float]:
    """Return the frequencies of resonances by what is written; those that outputs have in common once."""
    return {
        f"{frequency:.4g} {hertz}, damping ratio {damping:.3g}": frequency
        for frequency, damping in resonances
    }


def _draw_marks(panels: Sequence[Axes], marks: Mapping[str, float]) -> None:
    """Mark the frequencies of resonances in all panels, with their damping ratios above the first one."""
    first, last = np.log(panels[0].get_xlim())
    for row, (text, frequency) in enumerate(marks.items()):
        place = float((np.log(frequency) - first) / (last - first))
        for axes in panels:
            axes.axvline(frequency, color=FRAME, lw=0.8, ls=":")
        panels[0].annotate(
            text,
            (frequency, 1.0),
            xytext=(0, 4 + 72 * _ROW * row),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            ha="left" if place < _NEAR else "right" if place > 1.0 - _NEAR else "center",
            fontsize=REMARK,
            annotation_clip=False,
        )
