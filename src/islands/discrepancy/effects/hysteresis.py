"""Effects with hysteresis: stiction, backlash, a second hysteresis, asymmetric loops."""

from typing import Any

import numpy as np

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, ForceLaw, Signal, SimulationContext, Site
from islands.systems.hysteresis_operators import play_from, slider


def _stiction_form(u: Signal, values: Signal, _scene: SimulationContext) -> Signal:
    if values[0] <= 0.0:
        return u
    moved = np.empty_like(u)
    slider(u, values[0], moved)
    return moved


def _stiction_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "breakaway", context.input_unit, 0.0, 0.005 * context.input_peak, 0.0, 0.3 * context.input_peak
        ),
    )


def _stiction_grid(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    # It changes by leaps, so that no derivative leads to the best one: a fine grid has to.
    return tuple((float(part) * context.input_peak,) for part in np.geomspace(0.005, 0.3, 24))


STICTION = Effect(
    name="stiction",
    summary="The input acts in slips: it moves only beyond a breakaway distance",
    family="memory",
    site=Site.INPUT,
    parameters=_stiction_parameters,
    starting_points=_stiction_grid,
    form=_stiction_form,
    source="Choudhury, Thornhill and Shah, Modelling valve stiction, 2005",
    linear_parameters=0,
    similar_to="backlash, dead-zone, coulomb-friction",
    distinguished_by="samples of one slip have the same error while the input is slow; noise can hide that",
)


def _backlash_form(u: Signal, values: Signal, _scene: SimulationContext) -> Signal:
    return play_from(u, values[0]) if values[0] > 0.0 else u


def _backlash_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    return (
        Parameter("b", context.input_unit, 0.0, 0.005 * context.input_peak, 0.0, 0.3 * context.input_peak),
    )


def _backlash_grid(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple((part * context.input_peak,) for part in (0.005, 0.0175, 0.05, 0.125))


BACKLASH = Effect(
    name="backlash",
    summary="The input acts through a play of half width b",
    family="memory",
    site=Site.INPUT,
    parameters=_backlash_parameters,
    starting_points=_backlash_grid,
    form=_backlash_form,
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
    confounded_with=(STICTION, 2.0),
    similar_to="stiction, coulomb-friction, exponential-creep",
    distinguished_by="lost motion of constant width after each reversal",
)


def _relaxation_parameters(_scene: SimulationContext) -> tuple[Parameter, ...]:
    return (Parameter("relaxation", "1/s", 0.0, 0.05, -0.05, 10.0),)


def _relaxation_grid(_scene: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.1,), (1.0,))


RELAXATION = Effect(
    name="relaxation",
    summary="The hysteretic state decays: - h / tau in h'",
    family="memory",
    site=Site.CORE,
    parameters=_relaxation_parameters,
    starting_points=_relaxation_grid,
    form=None,
    source="Bouc-Wen models with relaxation; Ikhouane and Rodellar, Systems with Hysteresis, section 2",
    similar_to="exponential-creep",
    distinguished_by="hysteresis decays while the input is constant; slow loops are narrower",
)


def _rate_dependent_loop_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "rate-dependent-loop",
            f"s/{context.input_unit}",
            0.0,
            0.05 / context.force_coordinate.rate,
            -0.6 / context.force_coordinate.rate,
            5.0 / context.force_coordinate.rate,
        ),
    )


def _rate_dependent_loop_grid(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.1 / context.force_coordinate.rate,),)


RATE_DEPENDENT_LOOP = Effect(
    name="rate-dependent-loop",
    summary="The loop's shape changes with the rate: beta, gamma (1 + k |u'|)",
    family="memory",
    site=Site.CORE,
    parameters=_rate_dependent_loop_parameters,
    starting_points=_rate_dependent_loop_grid,
    form=None,
    source="Al Janaideh et al., generalized rate-dependent hysteresis models, 2009",
    similar_to="viscous, delay",
    distinguished_by="the width of the loop over the rate, at one amplitude",
)


def _loop_asymmetry_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "loop-asymmetry",
            f"1/{context.input_unit}",
            0.0,
            0.02 / context.input_peak,
            -0.35 / context.input_peak,
            0.35 / context.input_peak,
        ),
    )


def _loop_asymmetry_grid(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.04 / context.input_peak,),)


LOOP_ASYMMETRY = Effect(
    name="loop-asymmetry",
    summary="The loop is not symmetric: - delta |u'| |h| in h'",
    family="memory",
    site=Site.CORE,
    parameters=_loop_asymmetry_parameters,
    starting_points=_loop_asymmetry_grid,
    form=None,
    source="Wang and Wen, Parameter estimation of Bouc-Wen with asymmetry, 1998",
    similar_to="jump, offset, viscous-asymmetry",
    distinguished_by="the two branches of the loop are not mirror images",
)

#: Starting points: how quickly it turns, in one over the coordinate's peak, and g in parts of chi.
_SECOND_HYSTERESIS_QUICK, _SECOND_HYSTERESIS_BENT = (0.3, 1.0, 2.5, 8.0, 25.0), (0.0, 0.8, -1.2)


def _second_hysteresis_force(_x: float, _rate: float, z: float, numbers: Any) -> float:
    return numbers[0] * z


def _second_hysteresis_memory(_x: float, rate: float, z: float, numbers: Any) -> float:
    return rate - numbers[1] * abs(rate) * z - numbers[2] * rate * abs(z)


def _second_hysteresis_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    frame = context.force_coordinate
    turn = 1.0 / frame.peak
    return (
        Parameter("k", f"{frame.force_unit}/{frame.unit}", 0.0, 0.01 * frame.force * turn, frame.lower_bound),
        Parameter("chi", f"1/{frame.unit}", turn, 0.3 * turn, 0.0, 100.0 * turn),
        Parameter("g", f"1/{frame.unit}", 0.0, 0.3 * turn, -50.0 * turn, 50.0 * turn),
        Parameter(
            "z0", frame.unit, 0.0, 0.05 * frame.peak, -3.0 * frame.peak, 3.0 * frame.peak, initial=True
        ),
    )


def _second_hysteresis_grid(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    frame = context.force_coordinate
    return tuple(
        (0.03 * frame.force / frame.peak, quick / frame.peak, bent * quick / frame.peak, 0.0)
        for quick in _SECOND_HYSTERESIS_QUICK
        for bent in _SECOND_HYSTERESIS_BENT
    )


SECOND_HYSTERESIS = Effect(
    name="second-hysteresis",
    summary="A hysteretic element, beside one that may be there: + k z, z' = x' - chi |x'| z - g x' |z|",
    family="memory",
    site=Site.FORCE,
    parameters=_second_hysteresis_parameters,
    starting_points=_second_hysteresis_grid,
    form=ForceLaw(_second_hysteresis_force, _second_hysteresis_memory, initial_state_index=3),
    source="Ikhouane and Rodellar, Systems with Hysteresis, section 2",
    similar_to="exponential-creep, coulomb-friction, cubic-stiffness; on a single sine also quadratic-drag",
    distinguished_by="memory that does not depend on the rate: repeat the record at another frequency",
)
