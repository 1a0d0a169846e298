"""Figure of an effect that acts on a rate: the residual without it and with it, and its force."""

import numpy as np
from matplotlib.figure import Figure

from islands.diagnosis.rate_effect import find_rate_effect
from islands.diagnosis.result import Diagnosis
from islands.effects.catalogue import get_title
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect, ForceLaw
from islands.records.segments import map_segments
from islands.report.figures.diagnosis import BEFORE, draw_cells
from islands.report.figures.style import FRAME, SIMULATED, blank, finish, house_style, label

#: Points of the curve of the force.
_POINTS = 401


@house_style()
def draw_residual_over_rate(diagnosis: Diagnosis) -> Figure:
    """Draw the residual over the rate that an effect acts on, without the effect and with it, and its force.

    Without the effect, all other values are those of the extended simulation.

    Raises
    ------
    ValueError
        No claimed effect acts on a rate.
    """
    effect = find_rate_effect(diagnosis)
    if effect is None:
        raise ValueError("no claimed effect acts on a rate")
    record, context = diagnosis.record, diagnosis.best.simulation.context
    coordinate = context.force_coordinate
    signal = diagnosis.best.output if coordinate.is_output else context.u
    rate = map_segments(lambda part: np.gradient(part, record.dt), signal, record.segments)
    name = get_title(effect.name) or effect.name
    figure = blank(4.6, f"Residual over the rate that the effect acts on: {name}")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1.0))
    outputs = (
        (f"without {name}", BEFORE, _simulate_without(diagnosis, effect)),
        (f"with {name}", SIMULATED, diagnosis.best.output),
    )
    draw_cells(above, rate, [(text, colour, record.y - output) for text, colour, output in outputs])
    above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    above.set_ylabel(label("residual", record.output_unit))
    places = np.linspace(float(rate.min()), float(rate.max()), _POINTS)
    below.plot(places, _compute_force(diagnosis, effect, places), color=SIMULATED, lw=1.2)
    below.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
    moved, unit = record.input_names[0], record.input_units[0]
    if coordinate.is_output:
        moved, unit = record.output_name, record.output_unit
    below.set_xlabel(label(f"rate of {label(moved, unit).partition(' (')[0]}", f"{unit or '1'}/s"))
    below.set_ylabel(label("added", coordinate.force_unit))
    return finish(figure)


def _simulate_without(diagnosis: Diagnosis, effect: Effect) -> Signal:
    """Simulate the extended simulation with the nominal values of an effect, at which it vanishes."""
    fit = diagnosis.best
    values, part = fit.values.copy(), fit.simulation.get_slice(effect)
    values[part] = fit.simulation.nominal[part]
    return fit.simulation.simulate(values)


def _compute_force(diagnosis: Diagnosis, effect: Effect, places: Signal) -> Signal:
    """Return the force of an effect at each rate."""
    fit, law = diagnosis.best, effect.form
    assert isinstance(law, ForceLaw)
    context = fit.simulation.context
    numbers = np.array([*fit.values[fit.simulation.get_slice(effect)], *law.constants(context)])
    return np.array([law.force(0.0, float(place), 0.0, numbers) for place in places])
