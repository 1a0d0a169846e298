"""Effects with hysteresis: stiction, backlash, a second hysteresis, changes of the loop."""

from typing import Any

import numpy as np

from islands.effects.interface.context import Parameter, Points, Signal, SimulationContext
from islands.effects.interface.effect import Effect, ForceLaw, Formula, MapEquation, Site
from islands.kernels.memory_operators import jumper, play_from, slider
from islands.records.segments import MAX_RANGE_AT_REST

#: Largest breakaway distance, relative to the peak of the input.
_MAX_BREAKAWAY = 0.6

#: Breakaway distances of a held input that are compared, and most of those with different responses.
_BREAKAWAYS, _MAX_STARTS = np.linspace(0.01, _MAX_BREAKAWAY, 119), 40

#: Starting points of the half width of a play, relative to the peak of its signal.
_HALF_WIDTHS = (0.005, 0.0175, 0.05, 0.125)


def is_held(signal: Signal) -> bool:
    """Return whether a signal is constant for most of the time, and jumps between two samples."""
    rounding = MAX_RANGE_AT_REST * float(np.max(np.abs(signal)))
    return 2 * int(np.count_nonzero(np.abs(np.diff(signal)) <= rounding)) > signal.size - 1


def stick(u: Signal, breakaway: float) -> Signal:
    """Return the position of a slider that moves to an input if the distance exceeds a breakaway distance."""
    if breakaway <= 0.0:
        return u
    moved = np.empty_like(u)
    (jumper if is_held(u) else slider)(u, breakaway, moved)
    return moved


def _stiction_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    peak = context.input_peak
    return (Parameter("breakaway", context.input_unit, 0.0, 0.005 * peak, 0.0, _MAX_BREAKAWAY * peak),)


def _stiction_starting_points(context: SimulationContext, _residual: Signal) -> Points:
    # The response to the breakaway distance is discontinuous, so that derivatives do not lead to the optimum:
    # a fine grid replaces them.
    if not is_held(context.u):
        return tuple((float(part) * context.input_peak,) for part in np.geomspace(0.005, 0.3, 24))
    alike: dict[bytes, list[float]] = {}
    for breakaway in (_BREAKAWAYS * context.input_peak).tolist():
        moved = stick(context.u, breakaway)
        alike.setdefault(moved.tobytes(), []).append(breakaway)
    most = sorted(alike.values(), key=len, reverse=True)[:_MAX_STARTS]
    return tuple((float(np.mean(each)),) for each in sorted(most))


def _centre_breakaway(values: Signal, context: SimulationContext) -> Signal:
    """Return the middle between the largest distance of a held input that does not move it, and the next."""
    if not is_held(context.u) or values[0] <= 0.0:
        return values
    least, most = 0.0, np.inf
    for part in context.split():
        u = part.u[part.time < context.fit_end_time]
        if u.size == 0:
            break
        moved = stick(u, float(values[0]))
        distances = np.abs(u[1:] - moved[:-1])
        has_moved = distances > values[0]
        least = max(least, float(np.max(distances[~has_moved], initial=0.0)))
        most = min(most, float(np.min(distances[has_moved], initial=np.inf)))
    return np.array([(least + most) / 2.0]) if most < np.inf else values


STICTION = Effect(
    name="stiction",
    title="stick-slip of the input",
    summary="Stick-slip of the input: it moves only if it differs from u by a breakaway distance, then to u",
    family="memory",
    site=Site.INPUT,
    parameters=_stiction_parameters,
    starting_points=_stiction_starting_points,
    form=lambda u, values, _: stick(u, float(values[0])),
    equation=lambda _: MapEquation("z0", (("slider", "n0"),)),
    acts_between_samples=True,
    formula=Formula(
        "stick(x, s)",
        symbols=("s",),
        note="stick({x}, {s}) follows {x} only after that differs from it by {s}",
    ),
    centre=_centre_breakaway,
    source="Choudhury, Thornhill and Shah, Modelling valve stiction, 2005",
    linear_parameters=0,
    similar_to="backlash, dead-zone, coulomb-friction",
    distinguished_by="samples of one slip have the same error while the input is slow; noise can hide that",
    occurs_in="valve packings, seals and dry guides that stick",
)


def _backlash_form(u: Signal, values: Signal, _context: SimulationContext) -> Signal:
    return play_from(u, values[0]) if values[0] > 0.0 else u


#: Formula of a play of an input or of an output.
_PLAY = Formula("play(x, b)", note="play({x}, {b}) is a play of half width {b}")

BACKLASH = Effect(
    name="backlash",
    title="backlash of the input",
    summary="Backlash of the input: a play of half width b",
    family="memory",
    site=Site.INPUT,
    parameters=lambda context: (
        Parameter("b", context.input_unit, 0.0, 0.005 * context.input_peak, 0.0, 0.3 * context.input_peak),
    ),
    starting_points=lambda context, _: tuple((part * context.input_peak,) for part in _HALF_WIDTHS),
    form=_backlash_form,
    equation=lambda _: MapEquation("z0", (("play", "n0"),)),
    acts_between_samples=True,
    formula=_PLAY,
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
    confounded_with=(STICTION, 2.0),
    similar_to="stiction, coulomb-friction, exponential-creep",
    distinguished_by="lost motion of constant width after each reversal",
    occurs_in="gears, couplings, spindles and linkages with play",
)


def _sensor_hysteresis_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    peak = context.output_peak
    return (Parameter("b", context.output_unit, 0.0, 0.005 * peak, 0.0, 0.3 * peak),)


SENSOR_HYSTERESIS = Effect(
    name="sensor-hysteresis",
    title="play of the sensor",
    summary="Hysteresis of the sensor: the output has a play of half width b",
    family="memory",
    site=Site.OUTPUT,
    parameters=_sensor_hysteresis_parameters,
    starting_points=lambda context, _: tuple((part * context.output_peak,) for part in _HALF_WIDTHS),
    form=_backlash_form,
    equation=lambda _: MapEquation("z0", (("play", "n0"),)),
    formula=_PLAY,
    linear_parameters=0,
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
    similar_to="backlash, output-memory, coulomb-friction",
    distinguished_by="the output rests after each reversal of the motion, not of the input",
    occurs_in="linkages and gears of a position sensor, floats of a level sensor, magnetic sensors",
)


RELAXATION = Effect(
    name="relaxation",
    title="decay of the hysteresis",
    summary="The hysteretic state decays: - h / tau in h'",
    family="memory",
    site=Site.CORE,
    parameters=lambda _: (Parameter("relaxation", "1/s", 0.0, 0.05, -0.05, 10.0),),
    starting_points=lambda _context, _residual: ((0.1,), (1.0,)),
    form=None,
    formula=Formula(symbols=("r",)),
    source="Bouc-Wen models with relaxation; Ikhouane and Rodellar, Systems with Hysteresis, section 2",
    similar_to="exponential-creep",
    distinguished_by="hysteresis decays while the input is constant; slow loops are narrower",
    occurs_in="piezoelectric and magnetic materials, rubber",
)


RATE_DEPENDENT_LOOP = Effect(
    name="rate-dependent-loop",
    title="hysteresis that depends on the rate",
    summary="The shape of the loop depends on the rate: beta and gamma times (1 + k |u'|)",
    family="memory",
    site=Site.CORE,
    parameters=lambda context: (
        Parameter(
            "rate-dependent-loop",
            f"s/{context.input_unit}",
            0.0,
            0.05 / context.force_coordinate.rate,
            -0.6 / context.force_coordinate.rate,
            5.0 / context.force_coordinate.rate,
        ),
    ),
    starting_points=lambda context, _: ((0.1 / context.force_coordinate.rate,),),
    form=None,
    formula=Formula(symbols=("k",)),
    source="Al Janaideh et al., generalized rate-dependent hysteresis models, 2009",
    similar_to="viscous, delay",
    distinguished_by="the width of the loop over the rate, at one amplitude",
    occurs_in="piezoelectric and magnetic materials at changing frequencies, eddy currents",
)


LOOP_ASYMMETRY = Effect(
    name="loop-asymmetry",
    title="asymmetric hysteresis",
    summary="The loop is not symmetric: - delta |u'| |h| in h'",
    family="memory",
    site=Site.CORE,
    parameters=lambda context: (
        Parameter(
            "loop-asymmetry",
            f"1/{context.input_unit}",
            0.0,
            0.02 / context.input_peak,
            -0.35 / context.input_peak,
            0.35 / context.input_peak,
        ),
    ),
    starting_points=lambda context, _: ((0.04 / context.input_peak,),),
    form=None,
    formula=Formula(symbols=("delta",)),
    source="Wang and Wen, Parameter estimation of Bouc-Wen with asymmetry, 1998",
    similar_to="jump, offset, viscous-asymmetry",
    distinguished_by="the two branches of the loop are not mirror images",
    occurs_in="biased magnetic circuits, unipolar piezoelectric drives, preloaded springs",
)

#: Starting points of chi, times the peak of the coordinate.
_SECOND_HYSTERESIS_CHI = (0.3, 1.0, 2.5, 8.0, 25.0)

#: Starting points of g, relative to chi.
_SECOND_HYSTERESIS_G = (0.0, 0.8, -1.2)

#: Largest absolute value of g, relative to chi. With larger ones the element dissipates little, and draws the
#: curve of a saturating or hardening spring.
_MAX_RATIO = 1.5


def _second_hysteresis_force(_x: float, _rate: float, z: float, numbers: Any) -> float:
    return numbers[0] * z


def _second_hysteresis_derivative(_x: float, rate: float, z: float, numbers: Any) -> float:
    most = _MAX_RATIO * numbers[1]
    return rate - numbers[1] * abs(rate) * z - min(max(numbers[2], -most), most) * rate * abs(z)


def _project_second_hysteresis(values: Signal) -> Signal:
    projected, most = values.copy(), _MAX_RATIO * values[1]
    projected[2] = np.clip(values[2], -most, most)
    return projected


def _second_hysteresis_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    coordinate = context.force_coordinate
    inverse_peak = 1.0 / coordinate.peak
    return (
        Parameter(
            "k",
            f"{coordinate.force_unit}/{coordinate.unit}",
            0.0,
            0.01 * coordinate.force * inverse_peak,
            coordinate.lower_bound,
        ),
        Parameter("chi", f"1/{coordinate.unit}", inverse_peak, 0.3 * inverse_peak, 0.0, 100.0 * inverse_peak),
        Parameter(
            "g", f"1/{coordinate.unit}", 0.0, 0.3 * inverse_peak, -50.0 * inverse_peak, 50.0 * inverse_peak
        ),
        Parameter(
            "z0",
            coordinate.unit,
            0.0,
            0.05 * coordinate.peak,
            -3.0 * coordinate.peak,
            3.0 * coordinate.peak,
            initial=True,
        ),
    )


def _second_hysteresis_starting_points(context: SimulationContext, _residual: Signal) -> Points:
    coordinate = context.force_coordinate
    return tuple(
        (0.03 * coordinate.force / coordinate.peak, chi / coordinate.peak, g * chi / coordinate.peak, 0.0)
        for chi in _SECOND_HYSTERESIS_CHI
        for g in _SECOND_HYSTERESIS_G
    )


SECOND_HYSTERESIS = Effect(
    name="second-hysteresis",
    title="second hysteresis",
    summary=f"Another hysteretic element: + k z, z' = x' - chi |x'| z - g x' |z|, |g| <= {_MAX_RATIO} chi",
    family="memory",
    site=Site.FORCE,
    parameters=_second_hysteresis_parameters,
    starting_points=_second_hysteresis_starting_points,
    form=ForceLaw(
        _second_hysteresis_force,
        _second_hysteresis_derivative,
        initial_state_index=3,
        equation="n0*z",
        state_equation=f"v - n1*abs(v)*z - min(max(n2, -{_MAX_RATIO}*n1), {_MAX_RATIO}*n1)*v*abs(z)",
    ),
    formula=Formula("k*z", symbols=("k", "chi", "g"), states=(("z", "v - chi*abs(v)*z - g*v*abs(z)"),)),
    source="Ikhouane and Rodellar, Systems with Hysteresis, section 2",
    project=_project_second_hysteresis,
    similar_to="exponential-creep, coulomb-friction, cubic-stiffness; on a single sine also quadratic-drag",
    distinguished_by="memory that does not depend on the rate: repeat the record at another frequency",
    occurs_in="a second piezoelectric or magnetic part, joints that slip, rubber mounts",
)
