"""Static nonlinearities of input, coordinate, state and output."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from islands.effects.interface.context import Parameter, Points, Signal, SimulationContext
from islands.effects.interface.effect import (
    Effect,
    EffectTemplate,
    Formula,
    FormulaQuantity,
    MapEquation,
    Site,
)
from islands.effects.interface.force import ForceLaw


def _cubic_stiffness_force(x: float, _rate: float, _z: float, k: Any) -> float:
    return k[0] * x * x * x


def _cubic_stiffness_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    coordinate = context.force_coordinate
    return (
        Parameter(
            "k",
            f"{coordinate.force_unit}/{coordinate.unit}^3",
            0.0,
            0.01 * coordinate.force / coordinate.peak**3,
        ),
    )


CUBIC_STIFFNESS = Effect(
    name="cubic-stiffness",
    title="cubic stiffness",
    summary="Odd term of the characteristic: + k x^3 in the restoring force or in the output",
    family="shape",
    site=Site.FORCE,
    parameters=_cubic_stiffness_parameters,
    starting_points=lambda context, _: (
        (0.02 * context.force_coordinate.force / context.force_coordinate.peak**3,),
    ),
    form=ForceLaw(_cubic_stiffness_force, equation="n0*x*x*x"),
    formula=Formula("k*x**3"),
    source="Worden and Tomlinson, Nonlinearity in Structural Dynamics, section 2",
    similar_to="input-saturation",
    distinguished_by="an odd curve over the coordinate, at all rates",
    occurs_in="springs and flexures at large deflections, cables, buckled beams",
)


def _even_nonlinearity_force(x: float, _rate: float, _z: float, k: Any) -> float:
    return k[0] * x * x


def _even_nonlinearity_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    coordinate = context.force_coordinate
    return (
        Parameter(
            "k",
            f"{coordinate.force_unit}/{coordinate.unit}^2",
            0.0,
            0.01 * coordinate.force / coordinate.peak**2,
        ),
    )


EVEN_NONLINEARITY = Effect(
    name="even-nonlinearity",
    title="even nonlinearity",
    summary="Even term of the characteristic: + k x^2 in the restoring force or in the output",
    family="shape",
    site=Site.FORCE,
    parameters=_even_nonlinearity_parameters,
    starting_points=lambda context, _: (
        (0.02 * context.force_coordinate.force / context.force_coordinate.peak**2,),
    ),
    form=ForceLaw(_even_nonlinearity_force, equation="n0*x*x"),
    formula=Formula("k*x**2"),
    source="Worden and Tomlinson, Nonlinearity in Structural Dynamics, section 2",
    similar_to="absolute-value-sensor, offset",
    distinguished_by="a parabola over the coordinate",
    occurs_in="asymmetric springs, preloaded or cracked parts, magnetic attraction",
)

#: A dead zone is searched for only if the input comes closer to zero than this fraction of its peak.
_DEAD_ZONE_NEAR = 0.05


def _approaches_zero(context: SimulationContext) -> bool:
    # A dead zone cannot be distinguished from an offset if the input is never close to zero.
    return float(np.min(np.abs(context.u))) < _DEAD_ZONE_NEAR * context.input_peak


DEAD_ZONE = Effect(
    name="dead-zone",
    title="dead zone of the input",
    summary="Dead zone of the input: |u| is reduced by d, and u is zero if |u| < d",
    family="shape",
    site=Site.INPUT,
    parameters=lambda context: (
        Parameter(
            "d",
            context.input_unit,
            0.0,
            0.005 * context.input_peak,
            -0.2 * context.input_peak,
            0.3 * context.input_peak,
        ),
    ),
    starting_points=lambda context, _: tuple((part * context.input_peak,) for part in (0.0075, 0.025, 0.075)),
    form=lambda u, values, _: np.sign(u) * np.maximum(np.abs(u) - values[0], 0.0),
    equation=lambda _: MapEquation("sign(x)*max(abs(x) - n0, 0)"),
    is_applicable=_approaches_zero,
    acts_between_samples=True,
    formula=Formula("sign(x)*max(abs(x) - d, 0)"),
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
    similar_to="backlash, input-saturation",
    distinguished_by="flat around zero in both directions; a negative `d` is a step at zero",
    occurs_in="spool valves with overlap, drives below their breakaway command, worn linkages",
)


#: Starting points of a saturation, as parts of the peak that it cuts off.
_INPUT_CUTS = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
_OUTPUT_CUTS = (0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5)

#: Largest part of the peak that a saturation cuts off.
_MAX_CUT = 0.8


def _write_limit(peak: float, cut: str) -> str:
    level = f"{peak}*(1 - {cut})"
    return f"min(max(x, -({level})), {level})"


def _write_clip(get_range: Callable[[SimulationContext], tuple[float, str]]) -> Formula:
    """Return the formula of a saturation, given its peak and unit."""

    def list_quantities(values: Signal, context: SimulationContext) -> tuple[FormulaQuantity, ...]:
        peak, unit = get_range(context)
        return (FormulaQuantity("L", peak * (1.0 - float(values[0])), unit),)

    return Formula(
        "clip(x, -L, L)", quantities=list_quantities, note="clip({x}, -{L}, {L}) is {x}, limited to +-{L}"
    )


def _input_saturation_form(u: Signal, values: Signal, context: SimulationContext) -> Signal:
    level = context.input_peak * (1.0 - max(values[0], 0.0))
    return np.clip(u, -level, level)


INPUT_SATURATION = Effect(
    name="input-saturation",
    title="saturation of the input",
    summary="Saturation of the amplifier: u is limited to (1 - cut) times its peak",
    family="shape",
    site=Site.INPUT,
    parameters=lambda _: (Parameter("cut", "", 0.0, 0.02, 0.0, _MAX_CUT),),
    starting_points=lambda _context, _residual: tuple((cut,) for cut in _INPUT_CUTS),
    form=_input_saturation_form,
    equation=lambda context: MapEquation(_write_limit(context.input_peak, "max(n0, 0)")),
    acts_between_samples=True,
    formula=_write_clip(lambda context: (context.input_peak, context.input_unit)),
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
    linear_parameters=0,
    similar_to="cubic-stiffness, output-saturation",
    distinguished_by="a plateau over the input",
    occurs_in="limits of amplifier, valve or supply",
)


def _output_saturation_form(y: Signal, values: Signal, context: SimulationContext) -> Signal:
    level = context.output_peak * (1.0 - values[0])
    return np.clip(y, -level, level) if values[0] else y


def _measure_peak(context: SimulationContext) -> float:
    """Return the largest measured value, relative to the peak of the nominal simulation."""
    measured = context.fitted_output
    return 1.0 if measured is None else float(np.max(np.abs(measured))) / context.output_peak or 1.0


def _output_saturation_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    peak = _measure_peak(context)
    lower, upper = 1.0 - max(peak, 1.0), 1.0 - (1.0 - _MAX_CUT) * min(peak, 1.0)
    return (Parameter("cut", "", 0.0, 0.02, lower, upper),)


def _output_saturation_starting_points(context: SimulationContext, _residual: Signal) -> Points:
    """Return limits below the largest measured value: a record reaches its limit, but for the noise."""
    peak = _measure_peak(context)
    return tuple((1.0 - (1.0 - cut) * peak,) for cut in _OUTPUT_CUTS)


OUTPUT_SATURATION = Effect(
    name="output-saturation",
    title="saturation of the output",
    summary="Saturation of the sensor: y is limited to (1 - cut) times its peak",
    family="shape",
    site=Site.OUTPUT,
    parameters=_output_saturation_parameters,
    starting_points=_output_saturation_starting_points,
    form=_output_saturation_form,
    equation=lambda context: MapEquation(f"where(abs(n0), {_write_limit(context.output_peak, 'n0')}, x)"),
    formula=_write_clip(lambda context: (context.output_peak, context.output_unit)),
    source="Doebelin, Measurement Systems, section 3",
    linear_parameters=0,
    similar_to="input-saturation, state-clip",
    distinguished_by="a plateau over the output",
    occurs_in="range of a sensor or of its converter",
)


ABSOLUTE_VALUE_SENSOR = Effect(
    name="absolute-value-sensor",
    title="sensor gain that differs with the sign",
    summary="The sensor adds a fraction of the absolute value: y + k |y|",
    family="shape",
    site=Site.OUTPUT,
    parameters=lambda _: (Parameter("k", "", 0.0, 0.01, -0.8, 0.8),),
    starting_points=lambda _context, _residual: ((0.02,),),
    form=lambda y, values, _: y + values[0] * np.abs(y),
    equation=lambda _: MapEquation("x + n0*abs(x)"),
    formula=Formula("x + k*abs(x)"),
    source="Doebelin, Measurement Systems, section 3",
    similar_to="even-nonlinearity",
    distinguished_by="a kink at output zero",
    occurs_in="rectified or squared signals, encoders without direction, flow meters",
)


#: Parts of its peak below which an output is close to zero, and above which it has left it.
_NEAR_ZERO, _OFF_ZERO = 0.1, 0.3

#: Least number of times that an output without sign comes close to zero.
_MIN_RETURNS = 3


def _is_unsigned(context: SimulationContext) -> bool:
    """Return whether the measured output comes close to zero several times, and does not pass it."""
    if context.measured is None:
        return False
    peak = float(np.max(np.abs(context.measured)))
    if peak == 0.0 or float(np.min(context.measured)) < -_NEAR_ZERO * peak:
        return False
    parts = context.measured / peak
    is_off = parts[(parts < _NEAR_ZERO) | (parts > _OFF_ZERO)] > _OFF_ZERO
    return int(np.count_nonzero(is_off[:-1] & ~is_off[1:])) >= _MIN_RETURNS


UNSIGNED_SENSOR = Effect(
    name="unsigned-sensor",
    title="sensor without sign",
    summary="The sensor shows the output without its sign: (1 - k) y + k |y|",
    family="shape",
    site=Site.OUTPUT,
    parameters=lambda _: (Parameter("k", "", 0.0, 0.01, 0.0, 1.5),),
    starting_points=lambda _context, _residual: ((1.0,), (0.5,)),
    form=lambda y, values, _: (1.0 - values[0]) * y + values[0] * np.abs(y),
    equation=lambda _: MapEquation("(1 - n0)*x + n0*abs(x)"),
    is_applicable=_is_unsigned,
    formula=Formula("(1 - k)*x + k*abs(x)"),
    source="Doebelin, Measurement Systems, section 3",
    linear_parameters=0,
    similar_to="absolute-value-sensor, output-curve",
    distinguished_by="an output that turns at zero; `k` = 1 for the absolute value, 0.5 for a rectifier",
    occurs_in="speed from the frequency of pulses, rectifiers, amplitudes, flow meters without direction",
)


def outflow_law(state: str) -> Effect:
    """Return the linear outflow of one state as an effect; its value is in 1/s."""
    label = f"{OUTFLOW_LAW.name}:{state}"

    return Effect(
        name=label,
        summary=OUTFLOW_LAW.summary,
        family="shape",
        site=Site.CORE,
        parameters=lambda context: (Parameter(label, "1/s", 0.0, 1.0 / context.fit_end_time),),
        starting_points=lambda context, _: tuple(
            (times / context.fit_end_time,) for times in (1.0, 5.0, 25.0)
        ),
        form=None,
        formula=Formula(symbols=(f"l_{state}",)),
        source="Schoukens and Noel, Three benchmarks addressing open challenges, 2017",
    )


OUTFLOW_LAW = EffectTemplate(
    "outflow-law",
    "The outflow has a linear term in addition to Bernoulli's law: + l x in the flow out of one state",
    title="linear outflow",
    placed_title="linear outflow of {}",
    similar_to="state-clip, input-offset, a nonlinear sensor",
    distinguished_by="the outflow grows more steeply with the level than a square root",
    occurs_in="pipes and valves with laminar flow",
)


#: Starting points of the level, relative to the peak of the output.
_LEVELS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.5)

#: Starting points of the fraction of the overflow that the next state receives.
_CAUGHT = (0.0, 0.5)

#: Nominal value and upper bound of the level, relative to the peak of the output; no state reaches it.
_MAX_LEVEL = 4.0


def _make_state_limit(
    label: str,
    template: EffectTemplate,
    parameters: Callable[[SimulationContext], tuple[Parameter, ...]],
    starting_points: Callable[[SimulationContext, Signal], Sequence[tuple[float, ...]]],
    formula: Formula,
) -> Effect:
    """Return an effect that limits a state."""
    return Effect(
        name=label,
        summary=template.summary,
        family="shape",
        site=Site.CORE,
        parameters=parameters,
        starting_points=starting_points,
        form=None,
        formula=formula,
        source="Schoukens and Noel, Three benchmarks addressing open challenges, 2017",
        linear_parameters=0,
    )


def state_clip(state: str, unit: str = "", size: float = 0.0, spills: bool = True) -> Effect:
    """Return the limit on one state as an effect, with its unit and peak if they are not those of the output.

    The overflow of the last state of a chain is lost. A state that does not spill is limited to +-level.
    """
    label = f"{STATE_CLIP.name}:{state}"

    def parameters(context: SimulationContext) -> tuple[Parameter, ...]:
        peak, own = size or context.output_peak, unit or context.output_unit
        level = Parameter(label, own, _MAX_LEVEL * peak, 0.01 * peak, 0.1 * peak, _MAX_LEVEL * peak)
        return (level, Parameter(f"{label} caught", "", 0.0, 0.05, 0.0, 1.0)) if spills else (level,)

    def starting_points(context: SimulationContext, _residual: Signal) -> Points:
        levels = [level * (size or context.output_peak) for level in _LEVELS]
        return (
            tuple((level, caught) for level in levels for caught in _CAUGHT) if spills else tuple(zip(levels))
        )

    limit, caught = f"limit_{state}", f"caught_{state}"
    formula = Formula(symbols=(limit,), conditions=(f"abs(x) <= {limit}",))
    if spills:
        note = f"The part {{{caught}}} of what {{{limit}}} cuts off flows into the next state"
        formula = Formula(symbols=(limit, caught), conditions=(f"x <= {limit}",), note=note)
    return _make_state_limit(label, STATE_CLIP, parameters, starting_points, formula)


#: Starting points of the limits of a range, as parts of the range of the output by which they narrow it.
_CUTS = (-0.25, 0.0, 0.1, 0.25, 0.4)

#: Nominal limits of a range, beyond those of the output, in ranges of it; no state reaches them.
_FREE = 3.0


def state_range(state: str, unit: str) -> Effect:
    """Return a lower and an upper limit on one state, whose range is about that of the output."""
    label = f"{STATE_RANGE.name}:{state}"

    def find_range(context: SimulationContext) -> tuple[float, float]:
        measured = context.fitted_output
        if measured is None:
            return -context.output_peak, context.output_peak
        return float(np.min(measured)), float(np.max(measured))

    def parameters(context: SimulationContext) -> tuple[Parameter, ...]:
        low, high = find_range(context)
        span = high - low
        least, most = low - _FREE * span, high + _FREE * span
        return (
            Parameter(f"{label} lower", unit, least, 0.01 * span, least, high),
            Parameter(f"{label} upper", unit, most, 0.01 * span, low, most),
        )

    def starting_points(context: SimulationContext, _residual: Signal) -> Points:
        low, high = find_range(context)
        cuts = [-_FREE * (high - low), *(cut * (high - low) for cut in _CUTS)]
        return tuple((low + below, high - above) for below in cuts for above in cuts)[1:]

    lower, upper = f"lower_{state}", f"upper_{state}"
    formula = Formula(symbols=(lower, upper), conditions=(f"{lower} <= x", f"x <= {upper}"))
    return _make_state_limit(label, STATE_RANGE, parameters, starting_points, formula)


STATE_RANGE = EffectTemplate(
    "state-range",
    "A state is limited to a range from a lower to an upper level, or in one direction only",
    title="range of a state",
    placed_title="range of {}",
    similar_to="state-clip, output-saturation",
    distinguished_by="the output flattens later than the state, at two levels that are not opposite",
    occurs_in="end stops on both sides of a position, valves between closed and open",
)

STATE_CLIP = EffectTemplate(
    "state-clip",
    "A state is limited to a level, as in a tank that overflows; the next state may receive a fraction",
    title="limit of a state",
    placed_title="limit of {}",
    similar_to="output-saturation, input-offset, outflow-law",
    distinguished_by="the output flattens later than the state: an unmeasured state is clipped",
    occurs_in="tanks that overflow, end stops, limited integrators",
)
