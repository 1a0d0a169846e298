"""The catalogue of effects: what the analysis looks for, in the order in which maps act on a signal.

An effect is one file with one `EFFECT`; a line here puts it into the analysis, the report, the trials and the
guide.
"""

from collections.abc import Callable, Iterable, Mapping
from inspect import getmodule

from islands.discrepancy.effects import (
    absolute_value_sensor,
    ageing,
    baseline,
    clock_skew,
    creep,
    dead_zone,
    disturbance,
    even_nonlinearity,
    friction,
    hysteresis,
    input_offset,
    input_saturation,
    jump,
    linear_drift,
    logarithmic_creep,
    loop_asymmetry,
    model_form,
    nonlinearity,
    outflow_law,
    output_saturation,
    periodic_disturbance,
    quadratic_drag,
    rate_dependent_loop,
    relaxation,
    resonance,
    scale,
    second_hysteresis,
    sensor_gain,
    sensor_lag,
    state_clip,
    stiction,
    thermal_drift,
    time_variation,
    timing,
    viscous,
    viscous_asymmetry,
    wrong_parameter,
)
from islands.discrepancy.interfaces.effect import Effect

_MODULES = {
    module.EFFECT.name: module
    for module in (
        timing,
        clock_skew,
        scale,
        dead_zone,
        input_saturation,
        hysteresis,
        stiction,
        relaxation,
        rate_dependent_loop,
        loop_asymmetry,
        second_hysteresis,
        time_variation,
        ageing,
        viscous,
        friction,
        viscous_asymmetry,
        quadratic_drag,
        even_nonlinearity,
        nonlinearity,
        creep,
        logarithmic_creep,
        sensor_lag,
        resonance,
        absolute_value_sensor,
        output_saturation,
        sensor_gain,
        baseline,
        linear_drift,
        jump,
        thermal_drift,
        disturbance,
        periodic_disturbance,
    )
}

CATALOGUE: Mapping[str, Effect] = {name: module.EFFECT for name, module in _MODULES.items()}

#: Effects that a simulation's own parameters and states have, one of each.
OF_EACH: Mapping[str, Callable[..., Effect]] = {
    module.NAME: make
    for module, make in (
        (wrong_parameter, wrong_parameter.wrong_parameter),
        (state_clip, state_clip.state_clip),
        (input_offset, input_offset.input_offset),
        (outflow_law, outflow_law.outflow_law),
        (model_form, model_form.core_shape),
    )
}


def sentence(name: str) -> str:
    """Return what an effect is, in a sentence with its form."""
    cause = name.partition(":")[0]
    module = _MODULES[cause] if cause in _MODULES else getmodule(OF_EACH[cause])
    return (module.__doc__ or "").strip().partition("\n")[0].rstrip(".")


def in_order(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return effects in the order in which they act."""
    places = {name: place for place, name in enumerate(CATALOGUE)}
    return tuple(sorted(effects, key=lambda effect: places.get(effect.name, -1)))
