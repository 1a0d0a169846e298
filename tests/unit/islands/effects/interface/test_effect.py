"""Formulas and map equations of effects: readers and programs get what the simulation computes."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from islands.effects.catalogue import CATALOGUE, OF_EACH, find_entry
from islands.effects.channels import channel
from islands.effects.filters import low_pass
from islands.effects.hysteresis import stick
from islands.effects.interface.context import SimulationContext
from islands.effects.interface.effect import Effect, ForceLaw, Site, apply_map
from islands.effects.time_variation import GAIN_EFFECTS, gain_over_time
from islands.effects.timing import RESONANCE
from islands.expressions.evaluation import evaluate
from islands.expressions.parsing import parse_expression, parse_formula
from islands.kernels.lagrange import interpolate_at
from islands.kernels.memory_operators import lag_by_gap, lag_unevenly, limit_rate, play_from
from islands.records.segments import is_resting

#: Functions of formulas that act on each value by itself.
FUNCTIONS = {
    **{name: getattr(np, name) for name in ("abs", "sign", "cos", "sin", "clip", "round", "pi")},
    "max": np.maximum,
    "step": lambda time: 1.0 * (time > 0.0),
}

#: Effects without such a formula: they have states, or a function of the whole signal.
OF_WHOLE_SIGNAL = {
    *("delay", "clock-skew", "rate-limit", "backlash", "stiction", "second-hysteresis", "sensor-lag"),
    *("resonance", "exponential-creep", "logarithmic-creep", "varying-delay", "growing-lag"),
    "sensor-hysteresis",
    *(name for name, effect in CATALOGUE.items() if effect.is_free),
    *(name for name, effect in CATALOGUE.items() if effect.site == Site.CORE),
}

Array = NDArray[np.float64]

MAPS = [each for each in CATALOGUE.values() if each.site in (Site.INPUT, Site.OUTPUT)]

SAMPLES = 400


@pytest.fixture(scope="module")
def context() -> SimulationContext:
    rng = np.random.default_rng(3)
    time = np.arange(1500) * 0.01
    u = 40 * np.sin(2 * np.pi * 0.7 * time) * np.sin(2 * np.pi * 0.11 * time)
    channels = {"T_K": np.cumsum(rng.normal(size=time.size)), "w_V": rng.normal(size=time.size)}
    return SimulationContext(
        u, 0.01, channels, {"T_K": "K", "w_V": "V"}, 40.0, 33.0, "V", "um", 11.0, measured=u
    )


def _choose_values(effect: Effect, context: SimulationContext) -> np.ndarray:
    residual = 0.1 * np.sin(2 * np.pi * 7.3 * context.time)
    return np.array(effect.starting_points(context, residual)[-1])


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=CATALOGUE)
def test_every_effect_states_a_formula_with_its_quantities(
    effect: Effect, context: SimulationContext
) -> None:
    assert effect.formula is not None
    quantities = effect.formula.list_quantities(
        effect.parameters(context), _choose_values(effect, context), context
    )
    names = [each.symbol for each in quantities]
    assert all(name.isidentifier() for name in names)
    assert len(set(names)) == len(names)
    for text in filter(None, (effect.formula.text, *(right for _, right in effect.formula.states))):
        parse_formula(text)


@pytest.mark.parametrize("name", sorted(CATALOGUE.keys() - OF_WHOLE_SIGNAL))
def test_a_formula_has_the_values_of_the_form(name: str, context: SimulationContext) -> None:
    effect = CATALOGUE[name]
    values = _choose_values(effect, context)
    assert effect.formula is not None
    quantities = effect.formula.list_quantities(effect.parameters(context), values, context)
    x = np.linspace(-39.0, 39.0, context.u.size)
    v = np.where(np.arange(x.size) % 2, 1.0, -1.0) * context.force_coordinate.rate
    known = {
        **FUNCTIONS,
        "x": x,
        "v": v,
        "t": context.time,
        "w": channel(context, False),
        "T": context.duration,
        "T_0": 0.0,
        **{each.symbol: each.value for each in quantities},
    }
    if effect.formula.names == ("T", "T_0"):
        known["T"] = channel(context, True)
    written = eval(effect.formula.text, {"__builtins__": {}}, known)
    if isinstance(effect.form, ForceLaw):
        numbers = np.array([*values, *effect.form.constants(context)])
        computed = np.array([effect.form.force(*each, 0.0, numbers) for each in zip(x, v, strict=True)])
    else:
        computed = apply_map(effect, x, values, context)
    is_far = np.ones(x.size, dtype=bool)
    if "step" in effect.formula.text:  # which the form smooths over a few samples
        is_far = np.abs(context.time - known["t0"]) > 100 * context.dt
    if "round" in effect.formula.text:  # which the form smooths over a small part of a step
        is_far = np.abs((x - known["o"]) / known["q"] % 1.0 - 0.5) > 0.01
    np.testing.assert_allclose(written[is_far], computed[is_far], rtol=1e-9, atol=1e-9)


def test_every_template_is_found_by_its_name() -> None:
    assert all(find_entry(f"{name}:x") is template for name, template in OF_EACH.items())


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
NAMESPACE: dict[str, Callable[..., Array | float]] = {
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
        results[f"z{place}"] = NAMESPACE[name](x, context, *given)
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
