"""Closed form of an extended simulation: one difference equation, which is exported as a model.

It exists for models and linear simulations with effects that are static maps of the input or lines through
the output. Differential equations are integrated, see `islands.export.equations`; other effects have a
state or depend on the whole record.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

from islands.errors import ModelError
from islands.expressions.primitives import MUL, PRIMITIVES, SUB
from islands.expressions.tree import Apply, Constant, Expression, Lagged, replace_leaves
from islands.models.narx import Model, make_model, measured_model
from islands.persistence.models import narx_from_json
from islands.records.channel_names import AT_ONCE
from islands.simulators.specification.base import EffectSpec, ScalesSpec
from islands.simulators.specification.code import FmuSpec, ProgramSpec
from islands.simulators.specification.table import (
    ExtendedSpec,
    LinearSpec,
    LocalSpec,
    ModelSpec,
    SimulationSpec,
)

_Terms = list[tuple[Expression, float]]
_Values = Mapping[str, float]


def _apply_gain(x: Expression, values: _Values, _scales: ScalesSpec) -> Expression:
    return Apply(MUL, (Constant(1.0 + values["k"]), x))


def _saturate(x: Expression, values: _Values, scales: ScalesSpec) -> Expression:
    level = scales.input_peak * (1.0 - max(values["cut"], 0.0))
    upper = Apply(PRIMITIVES["min"], (x, Constant(level)))
    return Apply(PRIMITIVES["max"], (upper, Constant(-level)))


def _remove_dead_zone(x: Expression, values: _Values, _scales: ScalesSpec) -> Expression:
    beyond = Apply(SUB, (Apply(PRIMITIVES["abs"], (x,)), Constant(values["d"])))
    return Apply(MUL, (Apply(PRIMITIVES["sign"], (x,)), Apply(PRIMITIVES["max"], (beyond, Constant(0.0)))))


#: Static maps of the input, as expressions.
_INPUT_MAPS: Mapping[str, Callable[[Expression, _Values, ScalesSpec], Expression]] = MappingProxyType(
    {"input-gain": _apply_gain, "input-saturation": _saturate, "dead-zone": _remove_dead_zone}
)

#: Lines through the output: factor and constant.
_OUTPUT_LINES: Mapping[str, Callable[[_Values], tuple[float, float]]] = MappingProxyType(
    {
        "sensor-gain": lambda values: (1.0 + values["k"], 0.0),
        "offset": lambda values: (1.0, values["c"]),
    }
)


def closed_form(spec: SimulationSpec | LocalSpec) -> Model:
    """Return an extended simulation as a model.

    A linear simulation without a reference input describes deviations from the equilibrium at its first
    sample. Its model is in differences of samples, so that it continues the equilibrium of its start values.

    Raises
    ------
    ModelError
        The simulation is not a model or a linear one with known coefficients, or has another effect. The
        message names it.
    """
    match spec:
        case ModelSpec():
            return measured_model(narx_from_json(json.dumps(spec.model), spec.name))
        case ExtendedSpec(core=LinearSpec(numerator=tuple()) as core):
            model = _make_linear_model(core, spec.inputs[0])
        case ExtendedSpec():
            model = closed_form(spec.core)
        case FmuSpec() | ProgramSpec():
            raise _refuse(f"the simulation {spec.kind}", "plain, python or json")
        case _:
            raise _refuse(f"the simulation {spec.kind}")
    if spec.output_equation is not None:
        raise _refuse("an equation of the output with missing terms")
    if (spec.hold, spec.times) != ("first-order", 1):
        raise _refuse("a simulation with several steps per sample")
    # A map replaces the input inside the maps before it, so that the last one is applied first.
    before = [effect for effect in reversed(spec.effects) if effect.name in _INPUT_MAPS]
    for effect in (*before, *(effect for effect in spec.effects if effect.name not in _INPUT_MAPS)):
        model = _apply_effect(model, effect, spec.scales)
    return replace(model, output_name=spec.output, dt=spec.scales.dt)


def find_closed_form(spec: SimulationSpec | LocalSpec) -> Model | None:
    """Return an extended simulation as a model; None if it is not one difference equation."""
    try:
        return closed_form(spec)
    except ModelError:
        return None


def _refuse(what: str, formats: str = "plain, python, json, c or matlab") -> ModelError:
    possible = ", ".join([*_INPUT_MAPS, *_OUTPUT_LINES])
    return ModelError(
        f"{what} has no closed form as a difference equation: take the format {formats}. Other formats are "
        f"possible for a model or a linear simulation with the effects {possible}"
    )


def _make_linear_model(spec: LinearSpec, column: str) -> Model:
    """Return a linear simulation as a model, of the differences of its signals without a reference input."""
    assert spec.numerator is not None
    # Regressors read u(k-1) of the input that is read one sample early where the equation has u(k).
    lead = int(spec.delay == 0)
    lagged = [(Lagged(0, lag), coefficient) for lag, coefficient in enumerate(spec.denominator, start=1)]
    lagged += [
        (Lagged(1, lag), coefficient)
        for lag, coefficient in enumerate(spec.numerator, start=spec.delay + lead)
    ]
    terms: _Terms = list(lagged)
    if spec.reference_input is None:
        terms += [(Lagged(leaf.channel, leaf.lag + 1), -coefficient) for leaf, coefficient in lagged]
        terms.append((Lagged(0, 1), 1.0))
    else:
        at_rest = spec.level * (1.0 - sum(spec.denominator)) - spec.reference_input * sum(spec.numerator)
        terms.append((Constant(1.0), at_rest))
    return make_model(terms, (f"{column}{AT_ONCE * lead}",))


def _apply_effect(model: Model, effect: EffectSpec, scales: ScalesSpec) -> Model:
    values = {name: expression.value for name, expression in effect.parameters.items()}
    terms = zip([item.expression for item in model.regressors], model.parameters, strict=True)
    changed: _Terms
    if effect.name in _INPUT_MAPS:
        transform = _INPUT_MAPS[effect.name]
        changed = [
            (_replace_channel(expression, 1, lambda leaf: transform(leaf, values, scales)), parameter)
            for expression, parameter in terms
        ]
    elif effect.name in _OUTPUT_LINES:
        changed = _move_output(list(terms), *_OUTPUT_LINES[effect.name](values))
    else:
        raise _refuse(f"the effect {effect.name}")
    return make_model(changed, model.input_names, model.output_name, model.dt)


def _move_output(terms: _Terms, factor: float, constant: float) -> _Terms:
    """Return the terms of the output ``factor*y + constant``, in which past outputs are replaced likewise."""

    def undo(leaf: Expression) -> Expression:
        return Apply(MUL, (Constant(1.0 / factor), Apply(SUB, (leaf, Constant(constant)))))

    moved: _Terms = [(Constant(1.0), constant)]
    for expression, parameter in terms:
        if isinstance(expression, Lagged) and expression.channel == 0:
            moved += [(expression, parameter), (Constant(1.0), -parameter * constant)]
        else:
            moved.append((_replace_channel(expression, 0, undo), factor * parameter))
    return moved


def _replace_channel(
    expression: Expression, channel: int, transform: Callable[[Expression], Expression]
) -> Expression:
    return replace_leaves(expression, lambda leaf: transform(leaf) if leaf.channel == channel else leaf)
