"""Static curves of the units of a latent model, in units of the record."""

from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from islands.errors import ModelError
from islands.models.latent import LatentModel
from islands.records.dataset import Dataset
from islands.report.figures.style import BAND, FRAME, SIMULATED, blank, finish, house_style, label
from islands.validation.ensemble import Ensemble
from islands.validation.unit_curves import Abscissa, UnitCurve, trace_unit_curves

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
