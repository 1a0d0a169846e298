"""Free forms: effects whose shape is not assumed, with one coefficient for each part of the shape.

A named effect assumes a shape with one or two parameters. The free form of the same family at the same place
contains that shape approximately. It fits better only if the measured shape is another one.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from islands.effects.filters import low_pass
from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.effect import (
    Effect,
    ForceLaw,
    Formula,
    MakeEquation,
    Map,
    MapEquation,
    Site,
    write_curve_formula,
)
from islands.kernels.curve import PLACES, VALUES, interpolate, interpolate_curve, write_curve
from islands.kernels.memory_operators import lag_unevenly, play_from

#: Time constants of a free filter: from the sampling time to this fraction of the estimation part.
TIME_CONSTANTS, LONGEST = 6, 0.1

#: Half widths of the plays of a free memory, relative to the peak of the signal.
HALF_WIDTHS = (0.03, 0.06, 0.12, 0.25, 0.5)

#: Labels of the time constants of a free lag.
LAG_LABELS = ("falling fast", "falling slowly", "rising slowly", "rising fast")

#: Range of the rates of a damping curve, relative to the typical rate.
RATE_RANGE = 3.0

#: Starting value and typical change of a coefficient, relative to the signal that the form is added to.
START, CHANGE = 0.02, 0.01

_Text = Callable[[SimulationContext], str]
_Number = Callable[[SimulationContext], float]


def label_places(_context: SimulationContext) -> list[str]:
    """Return the labels of the values of a curve."""
    return [f"at {place:g}" for place in PLACES]


def label_times(context: SimulationContext) -> list[str]:
    """Return the labels of the values of a curve over time."""
    return [f"at {time:.3g} s" for time in _times(context)[1:]]


def label_half_widths(_context: SimulationContext) -> list[str]:
    """Return the labels of the weights of plays."""
    return [f"play {half_width:g}" for half_width in HALF_WIDTHS]


def label_time_constants(context: SimulationContext) -> list[str]:
    """Return the labels of the weights of low-passes."""
    return [f"tau {tau:.3g} s" for tau in _time_constants(context)]


def _times(context: SimulationContext) -> Signal:
    return np.linspace(0.0, context.fit_end_time, VALUES + 2)


def _time_constants(context: SimulationContext) -> Signal:
    return np.geomspace(context.dt, LONGEST * context.fit_end_time, TIME_CONSTANTS)


def add_curve(signal: Signal, values: Signal, peak: float) -> Signal:
    """Add a curve over a signal, whose range is given by the peak."""
    return signal + interpolate_curve(signal / peak, values)


def write_added_curve(peak: float) -> MapEquation:
    """Write `add_curve`."""
    return MapEquation(f"x + {write_curve(f'x/{peak}')}")


def add_low_passes(signal: Signal, values: Signal, context: SimulationContext) -> Signal:
    """Add what low-passes change, weighted by the values."""
    parts = [low_pass(signal, tau, context.dt) - signal for tau in _time_constants(context)]
    return signal + values @ np.array(parts)


def write_low_passes(context: SimulationContext) -> MapEquation:
    """Write `add_low_passes`."""
    return _write_changes([("low-pass", str(tau)) for tau in _time_constants(context)])


def _typical_rate(context: SimulationContext, peak: float) -> float:
    """Return a typical rate of a signal per second, from scales that an extended simulation keeps."""
    coordinate = context.force_coordinate
    return peak * coordinate.rate / (coordinate.peak or 1.0)


def lag_by_rate(signal: Signal, values: Signal, context: SimulationContext, peak: float) -> Signal:
    """Lag a signal with time constants that depend on its rate, which is slow or fast for the signal."""
    lagged: Signal = lag_unevenly(signal, context.dt, _typical_rate(context, peak), values)
    return lagged


def write_lag_by_rate(context: SimulationContext, peak: float) -> MapEquation:
    """Write `lag_by_rate`."""
    values = [f"n{place}" for place in range(len(LAG_LABELS))]
    return MapEquation("z0", (("lag-unevenly", str(_typical_rate(context, peak)), *values),))


def add_plays(signal: Signal, values: Signal, peak: float) -> Signal:
    """Add what plays change, weighted by the values."""
    return signal + values @ np.array([play_from(signal, part * peak) - signal for part in HALF_WIDTHS])


def write_plays(peak: float) -> MapEquation:
    """Write `add_plays`."""
    return _write_changes([("play", str(part * peak)) for part in HALF_WIDTHS])


def _write_changes(operators: list[tuple[str, ...]]) -> MapEquation:
    changes = [f"n{place}*(z{place} - x)" for place in range(len(operators))]
    return MapEquation(" + ".join(["x", *changes]), tuple(operators))


def interpolate_time(values: Signal, context: SimulationContext) -> Signal:
    """Return a curve over time that is zero at the start; the last value is held in the hold-out part."""
    return np.interp(context.time, _times(context), [0.0, *values])


def write_time_curve(context: SimulationContext) -> str:
    """Write `interpolate_time` as an expression: a sum of ramps."""
    times = _times(context)
    ramps = []
    for place, (first, last) in enumerate(pairwise(times.tolist())):
        rise = f"(n{place} - n{place - 1})" if place else "n0"
        ramps.append(f"{rise}*min(max((t - {first})/{last - first}, 0), 1)")
    return f"({' + '.join(ramps)})"


def multiply_over_time(signal: Signal, values: Signal, context: SimulationContext) -> Signal:
    """Multiply a signal by one and a curve over time."""
    return signal * (1.0 + interpolate_time(values, context))


def write_time_factor(context: SimulationContext) -> MapEquation:
    """Write `multiply_over_time`."""
    return MapEquation(f"x*(1 + {write_time_curve(context)})")


def _make_free_form(
    name: str,
    title: str,
    summary: str,
    family: str,
    site: Site,
    form: Map | ForceLaw,
    source: str,
    special_cases: tuple[str, ...],
    similar_to: str,
    distinguished_by: str,
    formula: Formula,
    labels: Callable[[SimulationContext], Sequence[str]],
    unit: _Text = lambda _: "",
    size: _Number = lambda _: 1.0,
    equation: MakeEquation | None = None,
    lower: float = -inf,
    acts_between_samples: bool = False,
) -> Effect:
    """Return an effect with a coefficient for each label, whose typical value is a fraction of ``size``."""

    def parameters(context: SimulationContext) -> tuple[Parameter, ...]:
        change = CHANGE * size(context)
        return tuple(Parameter(label, unit(context), 0.0, change, lower) for label in labels(context))

    return Effect(
        name=name,
        title=title,
        summary=summary,
        family=family,
        site=site,
        parameters=parameters,
        starting_points=lambda context, _: tuple(
            map(tuple, (START * size(context) * np.eye(len(labels(context)))).tolist())
        ),
        form=form,
        source=source,
        equation=equation,
        formula=formula,
        linear_parameters=0,
        acts_between_samples=acts_between_samples,
        is_free=True,
        depends_on_time=labels is label_times,
        special_cases=special_cases,
        similar_to=similar_to,
        distinguished_by=distinguished_by,
    )


def _stiffness_force(x: float, _rate: float, _z: float, numbers: Any) -> float:
    return interpolate(x / numbers[VALUES], numbers)


def _damping_force(_x: float, rate: float, _z: float, numbers: Any) -> float:
    return interpolate(rate / numbers[VALUES], numbers)


_CURVE = "IEC 61298-2, terminal-based linearity"
_FILTER = "Ljung, System Identification, section 4"
_LAG = "Isermann, Fault-Diagnosis Applications, section 5"
_MEMORY = "Kuhnen, Modeling, identification and compensation of complex hysteretic nonlinearities, 2003"
_CHANGE = "Niedzwiecki, Identification of Time-Varying Processes"

#: Effects with the shapes of the free forms. Characteristics of input, spring and output are often alike.
_DRIFTING = ("offset", "linear-drift", "jump", "thermal-drift", "exponential-creep", "logarithmic-creep")
_LINEAR = ("delay", "sensor-lag", "resonance", "viscous", "relaxation", *_DRIFTING[-2:])
_LOOPS = ("second-hysteresis", "loop-asymmetry", "rate-dependent-loop", "coulomb-friction")
_HYSTERETIC = ("backlash", "stiction", *_LOOPS)
_SPRINGS = ("even-nonlinearity", "cubic-stiffness")
_LIMITS = ("dead-zone", "input-saturation", "output-saturation")
_STATIC = ("offset", "input-offset", *_LIMITS, "absolute-value-sensor", *_SPRINGS)
_DAMPING = ("viscous", "coulomb-friction", "viscous-asymmetry", "quadratic-drag")
_CHANGING = ("gain-step", "ageing")

#: Formulas that forms of the input and of the output have in common.
_FILTERED = write_curve_formula("x + f(x)", "a sum of low-passes")
_LAGGED = write_curve_formula("f(x)", "an uneven lag")
_HYSTERESIS = write_curve_formula("x + f(x)", "a sum of plays")
_ADDED = write_curve_formula("x + f(x)", "a curve")
_SCALED = write_curve_formula("x*(1 + f(t))", "a curve over the time")

#: The free forms, in the order in which maps act on a signal.
FREE_FORMS: tuple[Effect, ...] = (
    _make_free_form(
        "input-filter",
        "linear dynamics of the input",
        "Any slow linear dynamics of the input: a sum of low-passes with six time constants",
        "timing",
        Site.INPUT,
        add_low_passes,
        _FILTER,
        _LINEAR,
        "delay, output-filter",
        "amplitude and phase that change with the frequency, also at small amplitudes",
        _FILTERED,
        label_time_constants,
        equation=write_low_passes,
    ),
    _make_free_form(
        "input-lag-curve",
        "uneven lag of the input",
        "Any uneven lag of the input: time constants rising and falling, above a typical rate and below",
        "timing",
        Site.INPUT,
        lambda u, values, context: lag_by_rate(u, values, context, context.input_peak),
        _LAG,
        ("sensor-lag", "rate-limit", "delay"),
        "input-filter, rate-limit, output-lag-curve",
        "transients that differ between up and down, or between slow and fast changes",
        _LAGGED,
        lambda _: LAG_LABELS,
        lambda _: "s",
        lambda context: context.dt / (2.0 * START),
        lambda context: write_lag_by_rate(context, context.input_peak),
        0.0,
    ),
    _make_free_form(
        "input-memory",
        "hysteresis of the input",
        "Any hysteresis of the input: a sum of plays with five half widths",
        "memory",
        Site.INPUT,
        lambda u, values, context: add_plays(u, values, context.input_peak),
        _MEMORY,
        _HYSTERETIC,
        "backlash, stiction, output-memory",
        "loops that do not become thinner when the input is slower",
        _HYSTERESIS,
        label_half_widths,
        equation=lambda context: write_plays(context.input_peak),
    ),
    _make_free_form(
        "input-curve",
        "curve of the input",
        "Any static characteristic of the input: a curve through seven values",
        "shape",
        Site.INPUT,
        lambda u, values, context: add_curve(u, values, context.input_peak),
        _CURVE,
        _STATIC,
        "dead-zone, input-saturation, output-curve",
        "a curve of the residual over the input, the same in both directions",
        _ADDED,
        label_places,
        lambda context: context.input_unit,
        lambda context: context.input_peak,
        lambda context: write_added_curve(context.input_peak),
        acts_between_samples=True,
    ),
    _make_free_form(
        "input-gain-curve",
        "changing gain of the input",
        "Any change of the gain of the input over time: a curve through eight values",
        "change",
        Site.INPUT,
        multiply_over_time,
        _CHANGE,
        _CHANGING,
        "gain-step, ageing, output-gain-curve",
        "a residual proportional to the input, with a factor that changes over time",
        _SCALED,
        label_times,
        equation=write_time_factor,
    ),
    _make_free_form(
        "damping-curve",
        "force over the rate",
        "Any force that depends on the rate: a curve through seven values",
        "memory",
        Site.FORCE,
        ForceLaw(
            _damping_force,
            constants=lambda context: (RATE_RANGE * context.force_coordinate.rate,),
            is_dissipative=True,
            equation=write_curve(f"v/n{VALUES}"),
        ),
        _CURVE,
        _DAMPING,
        "viscous, coulomb-friction, quadratic-drag",
        "a curve of the residual over the rate, the same at all places",
        write_curve_formula("f(v)", "a curve over the rate"),
        label_places,
        lambda context: context.force_coordinate.force_unit,
        lambda context: context.force_coordinate.force,
    ),
    _make_free_form(
        "stiffness-curve",
        "force over the coordinate",
        "Any force that depends on the coordinate: a curve through seven values",
        "shape",
        Site.FORCE,
        ForceLaw(
            _stiffness_force,
            constants=lambda context: (context.force_coordinate.peak,),
            equation=write_curve(f"x/n{VALUES}"),
        ),
        _CURVE,
        _STATIC,
        "cubic-stiffness, even-nonlinearity, input-curve",
        "a curve of the residual over the coordinate, the same at all rates",
        write_curve_formula("f(x)", "a curve over the coordinate"),
        label_places,
        lambda context: context.force_coordinate.force_unit,
        lambda context: context.force_coordinate.force,
    ),
    _make_free_form(
        "output-filter",
        "linear dynamics of the output",
        "Any slow linear dynamics of the output: a sum of low-passes with six time constants",
        "timing",
        Site.OUTPUT,
        add_low_passes,
        _FILTER,
        _LINEAR,
        "sensor-lag, exponential-creep, input-filter",
        "amplitude and phase that change with the frequency, also at small amplitudes",
        _FILTERED,
        label_time_constants,
        equation=write_low_passes,
    ),
    _make_free_form(
        "output-lag-curve",
        "uneven lag of the output",
        "Any uneven lag of the output: time constants rising and falling, above a typical rate and below",
        "timing",
        Site.OUTPUT,
        lambda y, values, context: lag_by_rate(y, values, context, context.output_peak),
        _LAG,
        ("sensor-lag", "delay"),
        "output-filter, input-lag-curve",
        "transients that differ between up and down, or between slow and fast changes",
        _LAGGED,
        lambda _: LAG_LABELS,
        lambda _: "s",
        lambda context: context.dt / (2.0 * START),
        lambda context: write_lag_by_rate(context, context.output_peak),
        0.0,
    ),
    _make_free_form(
        "output-memory",
        "hysteresis of the output",
        "Any hysteresis of the output: a sum of plays with five half widths",
        "memory",
        Site.OUTPUT,
        lambda y, values, context: add_plays(y, values, context.output_peak),
        _MEMORY,
        _HYSTERETIC,
        "second-hysteresis, input-memory",
        "loops that do not become thinner when the input is slower",
        _HYSTERESIS,
        label_half_widths,
        equation=lambda context: write_plays(context.output_peak),
    ),
    _make_free_form(
        "output-curve",
        "curve of the output",
        "Any static characteristic of the output: a curve through seven values",
        "shape",
        Site.OUTPUT,
        lambda y, values, context: add_curve(y, values, context.output_peak),
        _CURVE,
        _STATIC,
        "output-saturation, absolute-value-sensor, input-curve",
        "a curve of the residual over the output, the same in both directions",
        _ADDED,
        label_places,
        lambda context: context.output_unit,
        lambda context: context.output_peak,
        lambda context: write_added_curve(context.output_peak),
    ),
    _make_free_form(
        "output-gain-curve",
        "changing gain of the output",
        "Any change of the gain of the output over time: a curve through eight values",
        "change",
        Site.OUTPUT,
        multiply_over_time,
        _CHANGE,
        _CHANGING,
        "gain-step, ageing, input-gain-curve",
        "a residual proportional to the output, with a factor that changes over time",
        _SCALED,
        label_times,
        equation=write_time_factor,
    ),
    _make_free_form(
        "baseline-curve",
        "drift of the output, of any shape",
        "Any drift of the output: a curve over time through eight values",
        "baseline",
        Site.OUTPUT,
        lambda y, values, context: y + interpolate_time(values, context),
        _CHANGE,
        _DRIFTING,
        "linear-drift, jump, thermal-drift",
        "a slow residual that depends on the time alone",
        write_curve_formula("x + f(t)", "a curve over the time"),
        label_times,
        lambda context: context.output_unit,
        lambda context: context.output_peak,
        lambda context: MapEquation(f"x + {write_time_curve(context)}"),
    ),
)
