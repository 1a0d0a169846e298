"""Static nonlinearities of input, coordinate, state and output."""

from typing import Any

import numpy as np

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import (
    Effect,
    EffectTemplate,
    ForceLaw,
    Signal,
    SimulationContext,
    Site,
)


def _cubic_stiffness_force(x: float, _rate: float, _z: float, k: Any) -> float:
    return k[0] * x * x * x


def _cubic_stiffness_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    frame = context.force_coordinate
    return (Parameter("k", f"{frame.force_unit}/{frame.unit}^3", 0.0, 0.01 * frame.force / frame.peak**3),)


def _cubic_stiffness_grid(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02 * context.force_coordinate.force / context.force_coordinate.peak**3,),)


CUBIC_STIFFNESS = Effect(
    name="cubic-stiffness",
    summary="An odd part of the characteristic: + k x^3, of a stiffness on the side of what resists",
    family="shape",
    site=Site.FORCE,
    parameters=_cubic_stiffness_parameters,
    starting_points=_cubic_stiffness_grid,
    form=ForceLaw(_cubic_stiffness_force),
    source="Worden and Tomlinson, Nonlinearity in Structural Dynamics, section 2",
    similar_to="input-saturation; second-hysteresis if that does not dissipate",
    distinguished_by="an odd curve over the coordinate, at all rates",
)


def _even_nonlinearity_force(x: float, _rate: float, _z: float, k: Any) -> float:
    return k[0] * x * x


def _even_nonlinearity_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    frame = context.force_coordinate
    return (Parameter("k", f"{frame.force_unit}/{frame.unit}^2", 0.0, 0.01 * frame.force / frame.peak**2),)


def _even_nonlinearity_grid(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02 * context.force_coordinate.force / context.force_coordinate.peak**2,),)


EVEN_NONLINEARITY = Effect(
    name="even-nonlinearity",
    summary="An even part of the characteristic: + k x^2, of a stiffness on the side of what resists",
    family="shape",
    site=Site.FORCE,
    parameters=_even_nonlinearity_parameters,
    starting_points=_even_nonlinearity_grid,
    form=ForceLaw(_even_nonlinearity_force),
    source="Worden and Tomlinson, Nonlinearity in Structural Dynamics, section 2",
    similar_to="absolute-value-sensor, offset",
    distinguished_by="a parabola over the coordinate",
)

#: Part of its peak within which an input has to come to zero.
_DEAD_ZONE_NEAR = 0.05


def _dead_zone_form(u: Signal, values: Signal, _scene: SimulationContext) -> Signal:
    return np.sign(u) * np.maximum(np.abs(u) - values[0], 0.0)


def _dead_zone_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "d",
            context.input_unit,
            0.0,
            0.005 * context.input_peak,
            -0.2 * context.input_peak,
            0.3 * context.input_peak,
        ),
    )


def _dead_zone_grid(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple((part * context.input_peak,) for part in (0.0075, 0.025, 0.075))


def _dead_zone_crossed(context: SimulationContext) -> bool:
    # A dead zone cannot be told from an offset if the input never comes near zero.
    return float(np.min(np.abs(context.u))) < _DEAD_ZONE_NEAR * context.input_peak


DEAD_ZONE = Effect(
    name="dead-zone",
    summary="Nothing happens around zero: u is smaller by d, and zero below it",
    family="shape",
    site=Site.INPUT,
    parameters=_dead_zone_parameters,
    starting_points=_dead_zone_grid,
    form=_dead_zone_form,
    is_applicable=_dead_zone_crossed,
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
    similar_to="backlash, input-saturation",
    distinguished_by="flat around zero in both directions; a negative `d` is a step at zero",
)


def _input_saturation_form(u: Signal, values: Signal, context: SimulationContext) -> Signal:
    level = context.input_peak * (1.0 - max(values[0], 0.0))
    return np.clip(u, -level, level)


def _saturation_parameters(_scene: SimulationContext) -> tuple[Parameter, ...]:
    return (Parameter("cut", "", 0.0, 0.02, 0.0, 0.8),)


def _input_saturation_grid(_scene: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple((cut,) for cut in (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5))


INPUT_SATURATION = Effect(
    name="input-saturation",
    summary="The amplifier saturates: u is cut off a part of its peak below it",
    family="shape",
    site=Site.INPUT,
    parameters=_saturation_parameters,
    starting_points=_input_saturation_grid,
    form=_input_saturation_form,
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
    linear_parameters=0,
    similar_to="cubic-stiffness, output-saturation",
    distinguished_by="a plateau over the input",
)


def _output_saturation_form(y: Signal, values: Signal, context: SimulationContext) -> Signal:
    level = context.output_peak * (1.0 - max(values[0], 0.0))
    return np.clip(y, -level, level) if values[0] > 0.0 else y


def _output_saturation_grid(_scene: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple((cut,) for cut in (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5))


OUTPUT_SATURATION = Effect(
    name="output-saturation",
    summary="The sensor ends a part of the output's peak below it",
    family="shape",
    site=Site.OUTPUT,
    parameters=_saturation_parameters,
    starting_points=_output_saturation_grid,
    form=_output_saturation_form,
    source="Doebelin, Measurement Systems, section 3",
    linear_parameters=0,
    similar_to="input-saturation, state-clip",
    distinguished_by="a plateau over the output",
)


def _absolute_value_sensor_form(y: Signal, values: Signal, _scene: SimulationContext) -> Signal:
    return y + values[0] * np.abs(y)


def _absolute_value_sensor_parameters(_scene: SimulationContext) -> tuple[Parameter, ...]:
    return (Parameter("k", "", 0.0, 0.01, -0.8, 0.8),)


def _absolute_value_sensor_grid(
    _scene: SimulationContext, _residual: Signal
) -> tuple[tuple[float, ...], ...]:
    return ((0.02,),)


ABSOLUTE_VALUE_SENSOR = Effect(
    name="absolute-value-sensor",
    summary="The sensor adds a part of the absolute value: y + k |y|",
    family="shape",
    site=Site.OUTPUT,
    parameters=_absolute_value_sensor_parameters,
    starting_points=_absolute_value_sensor_grid,
    form=_absolute_value_sensor_form,
    source="Doebelin, Measurement Systems, section 3",
    similar_to="even-nonlinearity",
    distinguished_by="a kink at output zero",
)


def outflow_law(state: str) -> Effect:
    """Return the effect on one state, in 1/s."""
    label = f"{OUTFLOW_LAW.name}:{state}"

    def parameters(context: SimulationContext) -> tuple[Parameter, ...]:
        return (Parameter(label, "1/s", 0.0, 1.0 / context.fit_end_time),)

    def grid(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
        return tuple((times / context.fit_end_time,) for times in (1.0, 5.0, 25.0))

    return Effect(
        name=label,
        summary=OUTFLOW_LAW.summary,
        family="shape",
        site=Site.CORE,
        parameters=parameters,
        starting_points=grid,
        form=None,
        source="Schoukens and Noel, Three benchmarks addressing open challenges, 2017",
    )


#: The effect for one state or parameter.
OUTFLOW_LAW = EffectTemplate(
    "outflow-law",
    "The outflow has a linear part beside that of Bernoulli's law: + l x in the flow out of one state",
    similar_to="state-clip, input-offset, a nonlinear sensor",
    distinguished_by="the outflow grows more steeply with the level than a square root",
)


#: Starting points: the level in parts of the output's peak, and the part that spills on.
_LEVELS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.5)
_CAUGHT = (0.0, 0.5)

#: Further than this, in the output's peak, no state goes.
_FAR = 4.0


def state_clip(state: str) -> Effect:
    """Return the effect on one state; the last one of a chain spills nowhere."""
    label = f"{STATE_CLIP.name}:{state}"

    def parameters(context: SimulationContext) -> tuple[Parameter, ...]:
        peak = context.output_peak
        level = Parameter(label, context.output_unit, _FAR * peak, 0.01 * peak, 0.1 * peak, _FAR * peak)
        return (level, Parameter(f"{label} caught", "", 0.0, 0.05, 0.0, 1.0))

    def grid(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
        return tuple((level * context.output_peak, caught) for level in _LEVELS for caught in _CAUGHT)

    return Effect(
        name=label,
        summary=STATE_CLIP.summary,
        family="shape",
        site=Site.CORE,
        parameters=parameters,
        starting_points=grid,
        form=None,
        source="Schoukens and Noel, Three benchmarks addressing open challenges, 2017",
        linear_parameters=0,
    )


#: The effect for one state or parameter.
STATE_CLIP = EffectTemplate(
    "state-clip",
    "A state stops at a level, as a tank's at its rim: what is above it is lost, or spills on in part",
    similar_to="output-saturation, input-offset, outflow-law",
    distinguished_by="the output flattens later than the state: an unmeasured state is clipped",
)
