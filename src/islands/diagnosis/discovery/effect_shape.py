"""Shape of a named effect next to the free curve that the record shows in its place."""

from dataclasses import dataclass

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import estimate_deviations
from islands.diagnosis.inference.resemblance import describe_curve_signal
from islands.diagnosis.inference.strategies import SearchOutcome
from islands.effects.interface.context import Signal, SimulationContext
from islands.effects.interface.effect import Effect
from islands.effects.interface.force import ForceLaw
from islands.kernels.curve import PLACES

#: Places of the curve of a named effect, relative to the range of its signal; every thirtieth is in `PLACES`.
GRID = np.linspace(-1.0, 1.0, 241)

#: Least fraction of what the effect explains that the free curve has to explain. A smooth curve cannot follow
#: a kink or a step, and then shows another shape although the effect is right.
MIN_SHARE = 0.98


@dataclass(frozen=True, slots=True, eq=False)
class EffectShape:
    """Curve of a named effect, and the values of a free curve that is calibrated in its place.

    Both are without a gain and an offset: the straight line through the ends of the range is subtracted.

    Attributes
    ----------
    name, form : str
        Names of the effect and of the free form.
    signal, signal_unit, unit : str
        Signal that both depend on, its unit, and that of the curves.
    places, named : ndarray, shape (points,)
        Values of the signal, and the curve of the effect.
    free_places, free, half_widths : ndarray, shape (values,)
        Values of the signal, the free curve, and the half widths of its 95 % intervals.
    """

    name: str
    form: str
    signal: str
    signal_unit: str
    unit: str
    places: Signal
    named: Signal
    free_places: Signal
    free: Signal
    half_widths: Signal


def compare_shapes(outcome: SearchOutcome) -> EffectShape | None:
    """Return the shape of a single named effect.

    Returns
    -------
    EffectShape or None
        None without a free curve of the same kind at the same place that explains as much.
    """
    if len(outcome.hypothesis.effects) != 1:
        return None
    (effect,), fit = outcome.hypothesis.effects, outcome.hypothesis.fit
    context = fit.simulation.context
    for each in outcome.screened:
        signal = describe_curve_signal(each.effect.name, context)
        if signal is None or effect.site != each.effect.site or effect.cause not in each.effect.special_cases:
            continue
        before = outcome.base.mean_square
        if before - each.fit.mean_square < MIN_SHARE * (before - fit.mean_square):
            return None
        name, unit, peak = signal.name, signal.unit, signal.peak
        curve = _compute_curve(
            effect, fit.values[fit.simulation.get_slice(effect)], context, name, peak * GRID
        )
        part = each.fit.simulation.get_slice(each.effect)
        free = each.fit.values[part]
        half_widths = 1.96 * estimate_deviations(each.fit, outcome.target)[part]
        units = (unit, each.effect.parameters(context)[0].unit)
        return EffectShape(
            *(effect.cause, each.effect.name, name, *units),
            *(peak * GRID, curve, peak * PLACES, free, half_widths),
        )
    return None


def _compute_curve(
    effect: Effect, values: Signal, context: SimulationContext, signal: str, places: Signal
) -> Signal:
    """Return what an effect adds at each value of its signal, without a gain and an offset."""
    form = effect.form
    if form is None:
        raise ValueError(f"the effect {effect.name} has no form")
    if not isinstance(form, ForceLaw):
        added = form(places, values, context) - places
    else:
        numbers = np.array([*values, *form.constants(context)])
        zeros = np.zeros(places.size)
        points = zip(*((zeros, places) if signal == "rate" else (places, zeros)), strict=True)
        added = np.array([form.force(x, rate, 0.0, numbers) for x, rate in points])
    slope = (added[-1] - added[0]) / (places[-1] - places[0])
    curve: Signal = added - added[0] - slope * (places - places[0])
    return curve
