"""Figures of latent models: block diagram and curves of the units."""

from collections.abc import Sequence
from textwrap import fill, wrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, PathPatch, Rectangle
from matplotlib.path import Path
from numpy.typing import NDArray

from islands.errors import ModelError
from islands.models.latent import LatentModel
from islands.models.signal_statement import symbols
from islands.models.unit_functions import evaluate_curve
from islands.records.dataset import Dataset
from islands.report.figures.style import (
    BAND,
    FRAME,
    MEASURED,
    REMARK,
    SIMULATED,
    WIDTH,
    blank,
    finish,
    house_style,
    label,
)
from islands.validation.ensemble import Ensemble
from islands.validation.unit_curves import Abscissa, UnitCurve, trace_unit_curves

#: Horizontal places in inches: end of the names of inputs, their bus, bus of the states, bus to the states,
#: sum of the output, begin of its name.
_NAMES, _INPUTS, _STATES, _TO_STATES, _SUM, _OUTPUT = 1.1, 1.4, 2.25, 4.7, 5.5, 5.8

#: Left and right ends of the linear system and of the units in inches.
_LINEAR, _UNIT = (1.85, 5.1), (2.65, 4.3)

#: Heights in inches: line of text, unit, distance of units, and margins above the linear system, below it and
#: at the end.
_LINE, _HEIGHT, _PITCH, _ABOVE, _BETWEEN, _BELOW = 0.16, 0.46, 0.6, 0.36, 0.3, 0.12

#: Distance of two lines of a unit from its middle, and radius of the sum, in inches.
_APART, _RADIUS = 0.1, 0.09

#: Arguments of the drawn function of a unit.
_ARGUMENTS = np.linspace(-2.0, 2.0, 81)

#: Characters of a line of a signal's name, of symbols of inputs, and of a line in the linear system.
_NAME_CHARACTERS, _SYMBOL_CHARACTERS, _MODE_CHARACTERS = 15, 6, 54


@house_style()
def draw_structure(model: LatentModel) -> Figure:
    """Draw the block diagram of a model.

    There is an arrow for each block of parameters that is not zero: B from the inputs to the linear system, C
    from there to the output, D from the inputs to the output; of each unit, W from the states and V from the
    inputs, E to the states and F to the output. The constants s, o and level are not drawn.

    Parameters
    ----------
    model : LatentModel

    Returns
    -------
    Figure
        One axes in inches. The label of an arrow is the name of its block, with the number of a unit: ``W1``.
    """
    return finish(_Diagram(model).figure)


class _Diagram:
    """The figure of a model while it is drawn, with the vertical places of its parts."""

    def __init__(self, model: LatentModel) -> None:
        self._model, self._of = model, model.matrices
        lines = _describe_linear(model)
        names = _name_inputs(model)
        high = max(_LINE * (len(lines) + 1), _LINE * sum(name.count("\n") + 1.6 for name in names), 0.7)
        count = len(model.units)
        height = _ABOVE + high + _BELOW + (count and _BETWEEN + _PITCH * count)
        self.figure = blank(height)
        self.figure.set_layout_engine("none")
        self._axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self._axes.set(xlim=(0.0, WIDTH), ylim=(0.0, height))
        self._axes.set_axis_off()
        self._top, self._bottom = height - _ABOVE, height - _ABOVE - high
        self._middle = (self._top + self._bottom) / 2.0
        self._units = [self._bottom - _BETWEEN - _PITCH * (place + 0.5) for place in range(count)]
        self._draw_box(_LINEAR, self._middle, high)
        self._axes.text(
            *((_LINEAR[0] + _LINEAR[1]) / 2.0, self._middle, "\n".join(lines)),
            ha="center",
            va="center",
            fontsize=REMARK,
            linespacing=1.35,
        )
        self._draw_inputs(names)
        self._draw_output()
        for unit in range(count):
            self._draw_unit(unit)
        if self._of["W"].any():
            self._write(_STATES - 0.06, self._bottom - 0.12, "x", ha="right")

    def _draw_inputs(self, names: Sequence[str]) -> None:
        """Draw the names of the inputs, and the arrow of B."""
        heights = _LINE * np.array([name.count("\n") + 1.6 for name in names])
        places = self._middle + heights.sum() / 2.0 - np.cumsum(heights) + heights / 2.0
        for name, y in zip(names, places.tolist(), strict=True):
            self._write(_NAMES, y, name, ha="right")
            self._join((_NAMES + 0.05, y), (_INPUTS, y))
        self._join((_INPUTS, float(places[0])), (_INPUTS, float(places[-1])))
        b: NDArray[np.float64] = np.abs(self._of["B"]).max(axis=0)
        if b.any():
            self._point("B", (_INPUTS, self._middle), (_LINEAR[0], self._middle))
            self._name_used(b, self._middle)

    def _draw_output(self) -> None:
        """Draw the name of the output, the sum in front of it, and the arrows of C and D."""
        self._write(_OUTPUT, self._middle, fill(self._model.output_name, _NAME_CHARACTERS), ha="left")
        end = _OUTPUT - 0.04
        direct, units = self._of["D"], self._of["F"]
        if not (direct.any() or units.any()):
            if self._of["C"].any():
                self._point("C", (_LINEAR[1], self._middle), (end, self._middle))
            return
        circle = Circle((_SUM, self._middle), _RADIUS, facecolor="white", edgecolor=MEASURED, lw=1.0)
        self._axes.add_patch(circle)
        self._write(_SUM, self._middle, "+", ha="center")
        self._point("", (_SUM + _RADIUS, self._middle), (end, self._middle))
        if self._of["C"].any():
            self._point("C", (_LINEAR[1], self._middle), (_SUM - _RADIUS, self._middle))
        if direct.any():
            above = self._top + 0.16
            corners = ((_INPUTS, self._middle), (_INPUTS, above), (_SUM, above))
            self._point("D", *corners, (_SUM, self._middle + _RADIUS))
            self._name_used(direct, above)
            self._mark(_INPUTS, self._middle)

    def _draw_unit(self, unit: int) -> None:
        """Draw a unit with its function, and the arrows of its rows and columns of W, V, E and F."""
        y, number = self._units[unit], unit + 1
        name = self._model.units[unit]
        self._draw_box(_UNIT, y, _HEIGHT)
        self._draw_function(name, y)
        self._write(_UNIT[0] + 0.65, y, f"h{number}\n{name}", ha="left")
        inputs = self._of["V"][unit]
        states, direct = self._of["W"][unit].any(), inputs.any()
        if states:
            at = y + _APART * direct
            self._point(f"W{number}", (_STATES, self._bottom), (_STATES, at), (_UNIT[0], at))
            self._mark_before_last("W", unit, _STATES, at)
        if direct:
            at = y - _APART * states
            self._point(f"V{number}", (_INPUTS, self._middle), (_INPUTS, at), (_UNIT[0], at))
            self._name_used(inputs, at)
            self._mark(_INPUTS, self._middle)
            self._mark_before_last("V", unit, _INPUTS, at)
        feeds, shows = self._of["E"][:, unit].any(), bool(self._of["F"][unit])
        if feeds:
            at = y + _APART * shows
            self._point(f"E{number}", (_UNIT[1], at), (_TO_STATES, at), (_TO_STATES, self._bottom))
            self._mark_before_last("E", unit, _TO_STATES, at)
        if shows:
            at = y - _APART * feeds
            self._point(f"F{number}", (_UNIT[1], at), (_SUM, at), (_SUM, self._middle - _RADIUS))
            self._mark_before_last("F", unit, _SUM, at)

    def _mark_before_last(self, block: str, unit: int, x: float, y: float) -> None:
        """Mark the branch of a unit on a bus that further units share."""
        of = self._of[block]
        below = of[:, unit + 1 :] if block == "E" else of[unit + 1 :]
        if below.any():
            self._mark(x, y)

    def _draw_box(self, ends: tuple[float, float], y: float, height: float) -> None:
        left, right = ends
        corner = (left, y - height / 2.0)
        box = Rectangle(corner, right - left, height, facecolor="#f6f6f6", edgecolor=MEASURED, lw=1.0)
        self._axes.add_patch(box)

    def _draw_function(self, name: str, y: float) -> None:
        """Draw the function of a unit as a small picture."""
        values = evaluate_curve(name, _ARGUMENTS)
        values = (values - values.min()) / np.ptp(values) - 0.5
        points = np.column_stack([_UNIT[0] + 0.32 + 0.11 * _ARGUMENTS, y + 0.32 * values])
        self._axes.add_patch(PathPatch(Path(points), facecolor="none", edgecolor=SIMULATED, lw=1.4))

    def _name_used(self, weights: NDArray[np.float64], y: float) -> None:
        """Write the symbols of the inputs at an arrow that does not have all of them."""
        if weights.all():
            return
        pairs = zip(symbols(self._model.inputs)[1:], weights, strict=True)
        text = fill(", ".join(symbol for symbol, weight in pairs if weight), _SYMBOL_CHARACTERS)
        self._axes.text(_INPUTS + 0.06, y + 0.02, text, ha="left", va="bottom", fontsize=REMARK)

    def _point(self, block: str, *corners: tuple[float, float]) -> None:
        """Draw an arrow along corners."""
        arrow = FancyArrowPatch(
            path=Path(np.array(corners)), arrowstyle="-|>", mutation_scale=9.0, color=MEASURED, lw=1.0
        )
        arrow.set(joinstyle="miter", label=block)
        self._axes.add_patch(arrow)

    def _join(self, *ends: tuple[float, float]) -> None:
        self._axes.add_patch(PathPatch(Path(np.array(ends)), edgecolor=MEASURED, facecolor="none", lw=1.0))

    def _mark(self, x: float, y: float) -> None:
        """Mark a branch."""
        self._axes.add_patch(Circle((x, y), 0.03, color=MEASURED))

    def _write(self, x: float, y: float, text: str, ha: str) -> None:
        self._axes.text(x, y, text, ha=ha, va="center", fontsize=REMARK)


def _name_inputs(model: LatentModel) -> list[str]:
    """Return the names of the inputs, of several with their symbols, in lines."""
    pairs = zip(model.column_names, symbols(model.inputs)[1:], strict=True)
    return [
        fill(name if model.inputs == 1 else f"{name} ({symbol})", _NAME_CHARACTERS) for name, symbol in pairs
    ]


def _describe_linear(model: LatentModel) -> list[str]:
    """Return the lines of text of the linear system."""
    lines = [f"linear system with {model.order} state{'s' * (model.order > 1)}"]
    if modes := model.describe_modes():
        of = model.matrices
        slopes = "with the units, " * bool(model.units and of["E"].any() and of["W"].any())
        lines.append(f"{slopes}about {model.operating_point}:")
        lines += modes
        lines += ["(+- standard errors)"] * (model.known_errors is not None)
    return [part for line in lines for part in wrap(line, _MODE_CHARACTERS)]


#: Largest number of panels in a row, and their heights in inches if there is one and if there are several.
_COLUMNS, _ALONE, _SMALL = 2, 3.0, 2.2

#: Characters of a line of the labels of the ordinate and of the abscissa, by the panels in a row.
_CHARACTERS = {1: (36, 80), 2: (27, 36)}

#: Style of a curve beyond the estimation data.
_DASHED = (0, (3, 2))


@house_style()
def draw_unit_curves(
    model: LatentModel,
    record: Dataset,
    warm_up: int,
    ensemble: Ensemble | None = None,
    further: Dataset | None = None,
) -> Figure:
    """Draw the curve of every unit over the range of its argument in the free run; see `trace_unit_curves`.

    Parameters
    ----------
    model, record, warm_up, ensemble
        As of `trace_unit_curves`.
    further : Dataset, optional
        Validation data: where their arguments leave the range, the curve continues as a dashed line.

    Returns
    -------
    Figure
        An axes for each unit; none if the free run diverges at once.

    Raises
    ------
    ModelError
        The model has no units.
    RecordError
        The record does not match the model.
    """
    if not model.units:
        raise ModelError("the model has no units, so there are no curves: it is linear")
    curves = trace_unit_curves(model, record, warm_up, ensemble, further)
    if not curves:
        return blank(0.6, "the free run of the estimation data diverges at once: the units have no range")
    columns = min(len(curves), _COLUMNS)
    rows = -(-len(curves) // columns)
    figure = blank(0.7 + (_ALONE if columns == 1 else _SMALL) * rows)
    panels = figure.subplots(rows, columns, squeeze=False)
    for number, axes in enumerate(panels.flat):
        if number < len(curves):
            _draw_curve(axes, curves[number])
            for write, text, longest in zip(
                (axes.set_ylabel, axes.set_xlabel),
                _describe_axes(curves[number], number + 1, model, record),
                _CHARACTERS[columns],
                strict=True,
            ):
                write(fill(text, longest))
            axes.set_title(f"h{number + 1}: {curves[number].unit}")
        else:
            axes.remove()
    named = {
        text: handle
        for axes in figure.axes
        for handle, text in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if len(named) > 1:
        figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=3)
    return finish(figure)


def _draw_curve(axes: Axes, curve: UnitCurve) -> None:
    low, high = curve.reached
    inside = (curve.x >= low) & (curve.x <= high)
    if curve.half_width is not None:
        lower, upper = curve.y - curve.half_width, curve.y + curve.half_width
        axes.fill_between(curve.x, lower, upper, color=BAND, lw=0.0, label="95 % band of the ensemble")
    axes.plot(curve.x[inside], curve.y[inside], color=SIMULATED, lw=1.0, label="range of the estimation data")
    for beyond, end in ((curve.x <= low, low), (curve.x >= high, high)):
        if np.count_nonzero(beyond) > 1:
            axes.axvline(end, color=FRAME, lw=0.7, ls=":")
            name = "range of the validation data alone"
            axes.plot(curve.x[beyond], curve.y[beyond], color=SIMULATED, lw=1.0, ls=_DASHED, label=name)


def _describe_axes(curve: UnitCurve, number: int, model: LatentModel, record: Dataset) -> tuple[str, str]:
    """Return the labels of the ordinate and of the abscissa of a curve."""
    output = label(model.output_name, record.output_unit)
    effect = f"effect on {output} at rest" if curve.state < 0 else f"effect on x{curve.state + 1} in a sample"
    match curve.abscissa:
        case Abscissa.INPUT | Abscissa.CONSTANT_INPUT:
            name = label(model.column_names[curve.channel], record.input_units[curve.channel])
            is_read = curve.abscissa is Abscissa.INPUT
            return effect, name if is_read else f"{name}, constant, with the same argument"
        case Abscissa.OUTPUT:
            return effect, f"{output}, which the argument follows"
    return effect, f"argument of h{number} (standard deviations from its mean)"
