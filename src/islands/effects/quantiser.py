"""Actuator that moves in steps: a quantiser of the input."""

import numpy as np

from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect, Formula, MapEquation, Site

#: Width of the ramp between two levels, relative to the step. A jump would have no derivatives.
_RAMP = 0.005

#: Distance from a level at which the ramp to the next one begins, in steps.
_EDGE = 0.5 - 0.5 * _RAMP

#: Least number of values that an input takes. The levels of fewer values are a curve.
_MIN_VALUES = 10

#: Starting points of the step, relative to the peak of the input. The analysis finds better ones by a search
#: over steps and offsets, which needs the response of the plant.
_STEPS = (0.05, 0.1, 0.2)

#: Offsets relative to the step that are compared.
_OFFSETS = (np.arange(200) + 0.5) / 200.0 - 0.5

#: Distance of the input from the nearest level, in steps.
_DISTANCE = f"atan(tan({np.pi}*(x - n1)/max(n0, 1e-300)))/{np.pi}"


def _quantise(u: Signal, values: Signal, _context: SimulationContext) -> Signal:
    step, offset = values
    if step <= 0.0:
        return u
    places = (u - offset) / step
    levels = np.round(places)
    distance = places - levels
    ramp = np.maximum(distance - _EDGE, 0.0) + np.minimum(distance + _EDGE, 0.0)
    quantised: Signal = offset + step * (levels + ramp / _RAMP)
    return quantised


def _list_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    peak, unit = context.input_peak, context.input_unit
    return (
        Parameter("step", unit, 0.0, 0.005 * peak, 0.0, peak),
        Parameter("offset", unit, 0.0, 0.005 * peak, -peak, peak),
    )


def _find_steps(levels: Signal, u: Signal) -> tuple[float, float]:
    """Return the range of the steps that round an input to these multiples of a step; empty for none."""
    least, most = 0.0, np.inf
    for edges, is_least in ((levels + 0.5, levels > -0.5), (levels - 0.5, levels < 0.5)):
        bounds = u / edges
        least = max(least, float(np.max(bounds[is_least], initial=0.0)))
        most = min(most, float(np.min(bounds[~is_least], initial=np.inf)))
    return least, most


def _centre(values: Signal, context: SimulationContext) -> Signal:
    """Return the middle of the steps and offsets that round the fitted input alike.

    If multiples of a step do so, the offset is zero: it is usual, and fewer values are more certain.
    """
    if values[0] <= 0.0:
        return values
    u = np.unique(context.u[: round(context.fit_end_time / context.dt)])
    step, offset = values
    levels = np.round((u - offset) / step) + np.round(offset / step)
    found = []
    for part in (0.0, *_OFFSETS):
        least, most = _find_steps(levels + part, u)
        if most > least:
            found.append(((least + most) / 2.0, part, most - least))
        if found and part == 0.0:
            break
    if not found:
        return values
    steps, parts, widths = np.array(found).T
    step = np.average(steps, weights=widths)
    return np.array([step, step * np.average(parts, weights=widths)])


def _write_equation(_context: SimulationContext) -> MapEquation:
    ramp = f"(max({_DISTANCE} - {_EDGE}, 0) + min({_DISTANCE} + {_EDGE}, 0))/{_RAMP}"
    return MapEquation(f"where(n0, x - n0*{_DISTANCE} + n0*{ramp}, x)")


QUANTISED_INPUT = Effect(
    name="quantised-input",
    title="steps of the actuator",
    summary="The actuator moves in steps: u is rounded to the nearest level, offset + n step",
    family="shape",
    site=Site.INPUT,
    parameters=_list_parameters,
    starting_points=lambda context, _: tuple((part * context.input_peak, 0.0) for part in _STEPS),
    form=_quantise,
    equation=_write_equation,
    formula=Formula("o + q*round((x - o)/q)", symbols=("q", "o")),
    is_applicable=lambda context: np.unique(context.u).size >= _MIN_VALUES,
    centre=_centre,
    acts_between_samples=True,
    source="Widrow and Kollar, Quantization Noise, section 1",
    linear_parameters=0,
    extra_degrees_of_freedom=2,
    similar_to="stiction, dead-zone, input-curve, coloured noise",
    distinguished_by="a sawtooth of the residual over the input, the same in both directions",
    occurs_in="stepper motors, digital valves, converters with few bits, switched stages",
)
