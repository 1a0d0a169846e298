"""Figures of free forms: the shape of an effect without a name, and next to that of a named one."""

from matplotlib.figure import Figure

from islands.diagnosis.discovery.effect_shape import EffectShape
from islands.diagnosis.inference.finding import list_free_forms
from islands.diagnosis.result import Diagnosis
from islands.effects.catalogue import get_title
from islands.report.figures.style import FRAME, MEASURED, SIMULATED, blank, finish, house_style, label


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
