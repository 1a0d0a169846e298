"""Effects that change with time: a step of the gain, ageing."""

from collections.abc import Mapping

import numpy as np
import scipy

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Signal, SimulationContext, Site

#: Instants that a search begins from, and parts of the fitted record that are left free at its ends: what
#: changes there can be told from nothing by a few samples alone.
INSTANTS, MARGIN = 27, 0.06


def instant_grid(context: SimulationContext) -> tuple[float, ...]:
    """Return times that a search for a change begins from, in seconds."""
    first, last = instant_bounds(context)
    return tuple(float(time) for time in np.linspace(first, last, INSTANTS))


def instant_bounds(context: SimulationContext) -> tuple[float, float]:
    """Return the first and the last time at which a change may be looked for."""
    return MARGIN * context.fit_end_time, (1.0 - MARGIN) * context.fit_end_time


def smooth_step(context: SimulationContext, instant: float) -> Signal:
    """Return 0 before an instant and 1 behind it, within a few samples: a jump would have no derivative."""
    out: Signal = scipy.special.expit((context.time - instant) / (2 * context.dt))
    return out


def gain_over_time(own: Mapping[str, float], context: SimulationContext) -> Signal | float:
    """Return the factor of a gain that steps or ages, for a core that understands both; 1 if it does not."""
    gain: Signal | float = 1.0
    if "gain-step" in own:
        gain = gain * (1.0 + own["gain-step"] * smooth_step(context, own["gain-step instant"]))
    if "ageing" in own:
        gain = gain * (1.0 + own["ageing"] * context.time / context.duration)
    return gain


def _gain_step_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    return (
        Parameter("gain-step", "", 0.0, 0.01, -0.9, 2.0),
        Parameter("gain-step instant", "s", 0.0, 0.3 * context.fit_end_time / 45, *instant_bounds(context)),
    )


def _gain_step_grid(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple((0.02, instant) for instant in instant_grid(context))


GAIN_STEP = Effect(
    name="gain-step",
    summary="The gain changes at an instant: gain (1 + k) behind it",
    family="change",
    site=Site.CORE,
    parameters=_gain_step_parameters,
    starting_points=_gain_step_grid,
    form=None,
    source="Basseville and Nikiforov, Detection of Abrupt Changes",
    extra_degrees_of_freedom=1,
    similar_to="ageing",
    distinguished_by="the slope of output over input changes at one instant",
)


def _ageing_parameters(_scene: SimulationContext) -> tuple[Parameter, ...]:
    return (Parameter("ageing", "", 0.0, 0.01, -0.9, 2.0),)


def _ageing_grid(_scene: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02,),)


AGEING = Effect(
    name="ageing",
    summary="The gain drifts: gain (1 + k t / T) over the record's duration T",
    family="change",
    site=Site.CORE,
    parameters=_ageing_parameters,
    starting_points=_ageing_grid,
    form=None,
    source="Doebelin, Measurement Systems, section 3",
    similar_to="gain-step, linear-drift",
    distinguished_by="a residual proportional to time and output",
)
