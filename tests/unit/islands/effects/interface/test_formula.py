"""Formulas of effects: what readers see is what the simulation computes."""

import numpy as np
import pytest

from islands.effects.catalogue import CATALOGUE
from islands.effects.channels import channel
from islands.effects.interface.effect import Effect, ForceLaw, SimulationContext, Site, apply_map
from islands.expressions.parsing import parse_formula

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
