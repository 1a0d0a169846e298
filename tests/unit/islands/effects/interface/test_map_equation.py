"""Equations of maps: each has the values of the function of its effect."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from islands.effects.catalogue import CATALOGUE
from islands.effects.channels import channel
from islands.effects.filters import low_pass
from islands.effects.hysteresis import stick
from islands.effects.interface.effect import Effect, SimulationContext, Site
from islands.effects.time_variation import GAIN_EFFECTS, gain_over_time
from islands.effects.timing import RESONANCE
from islands.expressions.evaluation import evaluate
from islands.expressions.parsing import parse_expression
from islands.kernels.lagrange import interpolate_at
from islands.kernels.memory_operators import lag_by_gap, lag_unevenly, limit_rate, play_from
from islands.records.segments import is_resting

Array = NDArray[np.float64]

MAPS = [each for each in CATALOGUE.values() if each.site in (Site.INPUT, Site.OUTPUT)]

SAMPLES = 400


def make_context() -> SimulationContext:
    rng = np.random.default_rng(3)
    u = 40 * np.sin(0.044 * np.arange(SAMPLES)) * np.sin(0.007 * np.arange(SAMPLES))
    channels = {"T_K": np.cumsum(rng.normal(size=SAMPLES)), "w_V": rng.normal(size=SAMPLES)}
    units = {"T_K": "K", "w_V": "V"}
    return SimulationContext(
        u, 0.01, channels, units, 38.0, 33.0, "V", "um", 3.0, reference_duration=4.0, measured=u
    )


def resonate(signal: Array, context: SimulationContext, period: float, zeta: float) -> Array:
    assert callable(RESONANCE.form)
    return RESONANCE.form(signal, np.array([period, zeta]), context)


def rests(signal: Array, context: SimulationContext) -> float:
    return float(is_resting(signal[: round(context.fit_end_time / context.dt)]))


def interpolate(
    signal: Array, context: SimulationContext, e: float, tau: float, cosine: float, sine: float, f: float
) -> Array:
    angle = 2 * np.pi * f * context.time
    late = tau + cosine * np.cos(angle) + sine * np.sin(angle)
    return interpolate_at(signal, np.arange(signal.size) * (1.0 + e) - late / context.dt)


#: The operators as functions of the signal, the context and the arguments.
FUNCTIONS: dict[str, Callable[..., Array | float]] = {
    "low-pass": lambda x, context, tau: low_pass(x, tau, context.dt) if tau > 0.0 else x,
    "resonance": resonate,
    "play": lambda x, _, width: play_from(x, width) if width > 0.0 else x,
    "slider": lambda x, _, breakaway: stick(x, breakaway),
    "limit-rate": lambda x, context, inverse: limit_rate(x, context.dt / inverse) if inverse > 0.0 else x,
    "lag-unevenly": lambda x, context, slow, *times: lag_unevenly(x, context.dt, slow, np.array(times)),
    "lag-by-gap": lambda x, context, tau, inverse: lag_by_gap(x, context.dt, tau, inverse),
    "interpolate": interpolate,
    "first": lambda x, _: float(x[0]),
    "rests": rests,
    "temperature": lambda _, context: channel(context, True),
    "coupled": lambda _, context: channel(context, False),
}


def apply_equation(effect: Effect, x: Array, values: Array, context: SimulationContext) -> Array:
    assert effect.equation is not None
    written = effect.equation(context)
    numbers = {f"n{place}": value for place, value in enumerate(values.tolist())}
    results = {}
    for place, (name, *arguments) in enumerate(written.operators):
        given = [float(evaluate(parse_expression(each), numbers)) for each in arguments]
        results[f"z{place}"] = FUNCTIONS[name](x, context, *given)
    names = {"x": x, "t": context.time, **numbers, **results}
    return np.asarray(evaluate(parse_expression(written.equation), names)) + np.zeros(x.size)


def list_points(effect: Effect, context: SimulationContext) -> list[Array]:
    """Return starting points, a larger one, and the point at which the effect vanishes."""
    residual = np.sin(np.arange(SAMPLES))
    points = [np.array(each) for each in effect.starting_points(context, residual)]
    nominal = np.array([each.nominal for each in effect.parameters(context)])
    mixed = 5.0 * np.sum(points, axis=0) if effect.is_free else points[0]
    return [points[0], points[-1], mixed, nominal]


@pytest.mark.parametrize("effect", MAPS, ids=lambda each: each.name)
def test_an_equation_has_the_values_of_the_function(effect: Effect) -> None:
    context = make_context()
    signals = [context.u, 20.0 + np.cos(context.u), np.full(SAMPLES, 7.0)]
    for signal in signals:
        for values in list_points(effect, context):
            assert callable(effect.form)
            expected = effect.form(signal, values, context)
            found = apply_equation(effect, signal, values, context)
            np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", sorted(GAIN_EFFECTS))
def test_an_equation_of_a_gain_is_the_factor_over_time(name: str) -> None:
    context = make_context()
    effect = CATALOGUE[name]
    values = np.array(effect.starting_points(context, context.u)[-1])
    named = {each.name: value for each, value in zip(effect.parameters(context), values, strict=True)}
    found = apply_equation(effect, np.ones(SAMPLES), values, context)
    np.testing.assert_allclose(found, gain_over_time(named, context), rtol=1e-13)


def test_numbers_of_an_equation_are_the_scales_of_the_context() -> None:
    context = replace(make_context(), input_peak=2.0)
    found = apply_equation(CATALOGUE["input-saturation"], context.u, np.array([0.25]), context)
    assert (found.min(), found.max()) == (-1.5, 1.5)
