"""Free forms: effects whose shape is not assumed, with one coefficient for each part of the shape.

A named effect assumes a shape with one or two parameters. The free form of the same family at the same place
contains that shape approximately. It fits better only if the measured shape is another one.
"""

from collections.abc import Callable, Sequence
from math import inf
from typing import Any

import numpy as np

from islands.effects import free_maps
from islands.effects.interface.context import Parameter
from islands.effects.interface.effect import Effect, ForceLaw, Formula, Map, Signal, SimulationContext, Site
from islands.effects.interface.formula import write_curve_formula
from islands.effects.interface.map_equation import MakeEquation, MapEquation
from islands.kernels.curve import VALUES, interpolate, write_curve

#: Range of the rates of a damping curve, relative to the typical rate.
RATE_RANGE = 3.0

#: Starting value and typical change of a coefficient, relative to the signal that the form is added to.
START, CHANGE = 0.02, 0.01

_Text = Callable[[SimulationContext], str]
_Number = Callable[[SimulationContext], float]


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

    def starting_points(context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
        return tuple(map(tuple, (START * size(context) * np.eye(len(labels(context)))).tolist()))

    return Effect(
        name=name,
        title=title,
        summary=summary,
        family=family,
        site=site,
        parameters=parameters,
        starting_points=starting_points,
        form=form,
        source=source,
        equation=equation,
        formula=formula,
        linear_parameters=0,
        acts_between_samples=acts_between_samples,
        is_free=True,
        depends_on_time=labels is free_maps.label_times,
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
        free_maps.add_low_passes,
        _FILTER,
        _LINEAR,
        "delay, output-filter",
        "amplitude and phase that change with the frequency, also at small amplitudes",
        _FILTERED,
        free_maps.label_time_constants,
        equation=free_maps.write_low_passes,
    ),
    _make_free_form(
        "input-lag-curve",
        "uneven lag of the input",
        "Any uneven lag of the input: time constants rising and falling, above a typical rate and below",
        "timing",
        Site.INPUT,
        lambda u, values, context: free_maps.lag_by_rate(u, values, context, context.input_peak),
        _LAG,
        ("sensor-lag", "rate-limit", "delay"),
        "input-filter, rate-limit, output-lag-curve",
        "transients that differ between up and down, or between slow and fast changes",
        _LAGGED,
        lambda _: free_maps.LAG_LABELS,
        lambda _: "s",
        lambda context: context.dt / (2.0 * START),
        lambda context: free_maps.write_lag_by_rate(context, context.input_peak),
        0.0,
    ),
    _make_free_form(
        "input-memory",
        "hysteresis of the input",
        "Any hysteresis of the input: a sum of plays with five half widths",
        "memory",
        Site.INPUT,
        lambda u, values, context: free_maps.add_plays(u, values, context.input_peak),
        _MEMORY,
        _HYSTERETIC,
        "backlash, stiction, output-memory",
        "loops that do not become thinner when the input is slower",
        _HYSTERESIS,
        free_maps.label_half_widths,
        equation=lambda context: free_maps.write_plays(context.input_peak),
    ),
    _make_free_form(
        "input-curve",
        "curve of the input",
        "Any static characteristic of the input: a curve through seven values",
        "shape",
        Site.INPUT,
        lambda u, values, context: free_maps.add_curve(u, values, context.input_peak),
        _CURVE,
        _STATIC,
        "dead-zone, input-saturation, output-curve",
        "a curve of the residual over the input, the same in both directions",
        _ADDED,
        free_maps.label_places,
        lambda context: context.input_unit,
        lambda context: context.input_peak,
        lambda context: free_maps.write_added_curve(context.input_peak),
        acts_between_samples=True,
    ),
    _make_free_form(
        "input-gain-curve",
        "changing gain of the input",
        "Any change of the gain of the input over time: a curve through eight values",
        "change",
        Site.INPUT,
        free_maps.multiply_over_time,
        _CHANGE,
        _CHANGING,
        "gain-step, ageing, output-gain-curve",
        "a residual proportional to the input, with a factor that changes over time",
        _SCALED,
        free_maps.label_times,
        equation=free_maps.write_time_factor,
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
        free_maps.label_places,
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
        free_maps.label_places,
        lambda context: context.force_coordinate.force_unit,
        lambda context: context.force_coordinate.force,
    ),
    _make_free_form(
        "output-filter",
        "linear dynamics of the output",
        "Any slow linear dynamics of the output: a sum of low-passes with six time constants",
        "timing",
        Site.OUTPUT,
        free_maps.add_low_passes,
        _FILTER,
        _LINEAR,
        "sensor-lag, exponential-creep, input-filter",
        "amplitude and phase that change with the frequency, also at small amplitudes",
        _FILTERED,
        free_maps.label_time_constants,
        equation=free_maps.write_low_passes,
    ),
    _make_free_form(
        "output-lag-curve",
        "uneven lag of the output",
        "Any uneven lag of the output: time constants rising and falling, above a typical rate and below",
        "timing",
        Site.OUTPUT,
        lambda y, values, context: free_maps.lag_by_rate(y, values, context, context.output_peak),
        _LAG,
        ("sensor-lag", "delay"),
        "output-filter, input-lag-curve",
        "transients that differ between up and down, or between slow and fast changes",
        _LAGGED,
        lambda _: free_maps.LAG_LABELS,
        lambda _: "s",
        lambda context: context.dt / (2.0 * START),
        lambda context: free_maps.write_lag_by_rate(context, context.output_peak),
        0.0,
    ),
    _make_free_form(
        "output-memory",
        "hysteresis of the output",
        "Any hysteresis of the output: a sum of plays with five half widths",
        "memory",
        Site.OUTPUT,
        lambda y, values, context: free_maps.add_plays(y, values, context.output_peak),
        _MEMORY,
        _HYSTERETIC,
        "second-hysteresis, input-memory",
        "loops that do not become thinner when the input is slower",
        _HYSTERESIS,
        free_maps.label_half_widths,
        equation=lambda context: free_maps.write_plays(context.output_peak),
    ),
    _make_free_form(
        "output-curve",
        "curve of the output",
        "Any static characteristic of the output: a curve through seven values",
        "shape",
        Site.OUTPUT,
        lambda y, values, context: free_maps.add_curve(y, values, context.output_peak),
        _CURVE,
        _STATIC,
        "output-saturation, absolute-value-sensor, input-curve",
        "a curve of the residual over the output, the same in both directions",
        _ADDED,
        free_maps.label_places,
        lambda context: context.output_unit,
        lambda context: context.output_peak,
        lambda context: free_maps.write_added_curve(context.output_peak),
    ),
    _make_free_form(
        "output-gain-curve",
        "changing gain of the output",
        "Any change of the gain of the output over time: a curve through eight values",
        "change",
        Site.OUTPUT,
        free_maps.multiply_over_time,
        _CHANGE,
        _CHANGING,
        "gain-step, ageing, input-gain-curve",
        "a residual proportional to the output, with a factor that changes over time",
        _SCALED,
        free_maps.label_times,
        equation=free_maps.write_time_factor,
    ),
    _make_free_form(
        "baseline-curve",
        "drift of the output, of any shape",
        "Any drift of the output: a curve over time through eight values",
        "baseline",
        Site.OUTPUT,
        lambda y, values, context: y + free_maps.interpolate_time(values, context),
        _CHANGE,
        _DRIFTING,
        "linear-drift, jump, thermal-drift",
        "a slow residual that depends on the time alone",
        write_curve_formula("x + f(t)", "a curve over the time"),
        free_maps.label_times,
        lambda context: context.output_unit,
        lambda context: context.output_peak,
        lambda context: MapEquation(f"x + {free_maps.write_time_curve(context)}"),
    ),
)
