"""Changes of the gain: a step at an instant, ageing, a temperature."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import scipy

from islands.effects.channels import TEMPERATURE_NOTE, channel, channel_range, channel_unit, has_channel
from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect, Formula, FormulaQuantity, MapEquation, Site

#: Names of the effects that change the gain.
GAIN_EFFECTS = frozenset(("gain-step", "ageing"))

#: Number of candidate instants of a change.
INSTANTS = 27

#: Note on the formula of a step.
STEP_NOTE = "step(t - {t0}) is 0 before {t0}, and 1 after it"

#: Margin at each end of the estimation part, relative to its duration. Changes are not searched for in it,
#: since too few samples would show them.
MARGIN = 0.06


def candidate_instants(context: SimulationContext) -> tuple[float, ...]:
    """Return the instants from which the search for a change starts, in seconds."""
    first, last = instant_bounds(context)
    return tuple(float(time) for time in np.linspace(first, last, INSTANTS))


def instant_bounds(context: SimulationContext) -> tuple[float, float]:
    """Return the first and the last possible instant of a change, in seconds."""
    return MARGIN * context.fit_end_time, (1.0 - MARGIN) * context.fit_end_time


def smooth_step(context: SimulationContext, instant: float) -> Signal:
    """Return a step from 0 to 1 at an instant, smoothed over a few samples so that it has a derivative."""
    width = context.step_width * context.dt
    return _make_step(instant, width, context.start_time, context.dt, context.u.size)


@lru_cache(maxsize=4)
def _make_step(instant: float, width: float, start: float, dt: float, samples: int) -> Signal:
    """Return a smooth step over time; most derivatives have it in common."""
    time = start + dt * np.arange(samples, dtype=np.float64)
    out: Signal = scipy.special.expit((time - instant) / width)
    return out


def write_step(context: SimulationContext, instant: str) -> str:
    """Write `smooth_step` as an expression of the time, given that of the instant."""
    return f"(1/(1 + exp(({instant} - t)/{context.step_width * context.dt})))"


def gain_over_time(effect_parameters: Mapping[str, float], context: SimulationContext) -> Signal | float:
    """Return the gain factor of the effects ``gain-step`` and ``ageing``; 1 if neither is active."""
    gain: Signal | float = 1.0
    if "gain-step" in effect_parameters:
        gain = gain * (
            1.0
            + effect_parameters["gain-step"] * smooth_step(context, effect_parameters["gain-step instant"])
        )
    if "ageing" in effect_parameters:
        gain = gain * (1.0 + effect_parameters["ageing"] * context.time / context.duration)
    return gain


GAIN_STEP = Effect(
    name="gain-step",
    title="step of the gain",
    summary="Step of the gain at an instant: gain (1 + k) after it",
    family="change",
    site=Site.CORE,
    parameters=lambda context: (
        Parameter("gain-step", "", 0.0, 0.01, -0.9, 2.0),
        Parameter("gain-step instant", "s", 0.0, 0.3 * context.fit_end_time / 45, *instant_bounds(context)),
    ),
    starting_points=lambda context, _: tuple((0.02, instant) for instant in candidate_instants(context)),
    form=None,
    formula=Formula("x*(1 + k*step(t - t0))", symbols=("k", "t0"), note=STEP_NOTE),
    source="Basseville and Nikiforov, Detection of Abrupt Changes",
    equation=lambda context: MapEquation(f"x*(1 + n0*{write_step(context, 'n1')})"),
    extra_degrees_of_freedom=1,
    depends_on_time=True,
    similar_to="ageing",
    distinguished_by="the slope of output over input changes at one instant",
    occurs_in="switched ranges, a part that broke or was exchanged during the record",
)


AGEING = Effect(
    name="ageing",
    title="drift of the gain",
    summary="Drift of the gain: gain (1 + k t / T) over the record's duration T",
    family="change",
    site=Site.CORE,
    parameters=lambda _: (Parameter("ageing", "", 0.0, 0.01, -0.9, 2.0),),
    starting_points=lambda _context, _residual: ((0.02,),),
    form=None,
    formula=Formula(
        "x*(1 + k*t/T)",
        quantities=lambda values, context: (
            FormulaQuantity("k", float(values[0]), "", "ageing"),
            FormulaQuantity("T", context.duration, "s"),
        ),
    ),
    source="Doebelin, Measurement Systems, section 3",
    equation=lambda context: MapEquation(f"x*(1 + n0*t/{context.duration})"),
    depends_on_time=True,
    similar_to="gain-step, linear-drift",
    distinguished_by="a residual proportional to time and output",
    occurs_in="heating of a drive or sensor, wear, depolarisation during the record",
)


TEMPERATURE_GAIN = Effect(
    name="temperature-gain",
    title="gain that depends on the temperature",
    summary="The gain depends on a temperature: u (1 + k (T - T(0))), where T is a given channel",
    family="change",
    site=Site.INPUT,
    parameters=lambda context: (
        Parameter("k", f"1/{channel_unit(context, True)}", 0.0, 0.01 / channel_range(context, True)),
    ),
    starting_points=lambda context, _: ((0.02 / channel_range(context, True),),),
    form=lambda u, values, context: u * (1.0 + values[0] * channel(context, True)),
    equation=lambda _: MapEquation("x*(1 + n0*z0)", (("temperature",),)),
    formula=Formula("x*(1 + k*(T - T_0))", names=("T", "T_0"), note=TEMPERATURE_NOTE),
    source="Doebelin, Measurement Systems, section 2",
    is_applicable=lambda context: has_channel(context, True),
    similar_to="ageing if the temperature only rises, thermal-drift",
    distinguished_by="a residual proportional to the input and to a channel in K, degC or degF",
    occurs_in="magnets, viscosity in valves, piezo ceramics, resistance of a winding",
)
