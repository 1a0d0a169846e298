"""Catalogue of effects.

To add an effect, define it in the file of its family and add it to `_IN_ORDER`.
"""

from collections.abc import Iterable, Mapping, Sequence

from islands.effects.baseline import INPUT_OFFSET, JUMP, LINEAR_DRIFT, OFFSET, THERMAL_DRIFT
from islands.effects.creep import EXPONENTIAL_CREEP, LOGARITHMIC_CREEP
from islands.effects.disturbance import CROSS_COUPLING, PERIODIC_DISTURBANCE, SECOND_INPUT
from islands.effects.free_forms import FREE_FORMS
from islands.effects.friction import (
    COULOMB_FRICTION,
    QUADRATIC_DRAG,
    VISCOUS,
    VISCOUS_ASYMMETRY,
)
from islands.effects.hysteresis import (
    BACKLASH,
    LOOP_ASYMMETRY,
    RATE_DEPENDENT_LOOP,
    RELAXATION,
    SECOND_HYSTERESIS,
    SENSOR_HYSTERESIS,
    STICTION,
)
from islands.effects.interface.effect import Effect, EffectTemplate
from islands.effects.nonlinearity import (
    ABSOLUTE_VALUE_SENSOR,
    CUBIC_STIFFNESS,
    DEAD_ZONE,
    EVEN_NONLINEARITY,
    INPUT_SATURATION,
    OUTFLOW_LAW,
    OUTPUT_SATURATION,
    STATE_CLIP,
    STATE_RANGE,
    UNSIGNED_SENSOR,
)
from islands.effects.quantiser import QUANTISED_INPUT
from islands.effects.scale import INPUT_GAIN, SENSOR_GAIN, WRONG_PARAMETER
from islands.effects.spatial_period import COGGING, CYCLIC_ERROR
from islands.effects.sweep import SWEPT_DISTURBANCE, SWEPT_INTERFERENCE
from islands.effects.time_variation import AGEING, GAIN_STEP, TEMPERATURE_GAIN
from islands.effects.timing import (
    CLOCK_SKEW,
    DELAY,
    GROWING_LAG,
    RATE_LIMIT,
    RESONANCE,
    SENSOR_LAG,
    VARYING_DELAY,
)

#: Name of the effect.
CORE_SHAPE = "core-shape"

MODEL_FORM = EffectTemplate(
    CORE_SHAPE,
    "The model lacks terms psi |y - c u|, |psi| (y - c u) or psi(k-1), where psi is one of its regressors",
    title="wrong form of the model",
    similar_to="second-hysteresis, coulomb-friction, exponential-creep",
    distinguished_by="a loop that is too wide or too narrow wherever the input moves",
)

#: Effects and free forms, in the order in which maps act on a signal. Drifts and disturbances move the
#: scale of an encoder, so that they act before its cyclic error. A second input acts behind the actuator of
#: the first one. The order also breaks ties between scores: another order changes results.
_IN_ORDER: tuple[Effect, ...] = (
    DELAY,
    VARYING_DELAY,
    CLOCK_SKEW,
    INPUT_GAIN,
    DEAD_ZONE,
    INPUT_SATURATION,
    RATE_LIMIT,
    QUANTISED_INPUT,
    BACKLASH,
    STICTION,
    RELAXATION,
    RATE_DEPENDENT_LOOP,
    LOOP_ASYMMETRY,
    SECOND_HYSTERESIS,
    GAIN_STEP,
    AGEING,
    VISCOUS,
    COULOMB_FRICTION,
    VISCOUS_ASYMMETRY,
    QUADRATIC_DRAG,
    EVEN_NONLINEARITY,
    CUBIC_STIFFNESS,
    COGGING,
    EXPONENTIAL_CREEP,
    LOGARITHMIC_CREEP,
    SENSOR_LAG,
    GROWING_LAG,
    RESONANCE,
    SENSOR_HYSTERESIS,
    ABSOLUTE_VALUE_SENSOR,
    UNSIGNED_SENSOR,
    OUTPUT_SATURATION,
    OFFSET,
    LINEAR_DRIFT,
    JUMP,
    THERMAL_DRIFT,
    CROSS_COUPLING,
    TEMPERATURE_GAIN,
    SECOND_INPUT,
    SWEPT_DISTURBANCE,
    PERIODIC_DISTURBANCE,
    SWEPT_INTERFERENCE,
    CYCLIC_ERROR,
    SENSOR_GAIN,
    *FREE_FORMS,
)


class _Effects(tuple[Effect, ...]):
    """Effects whose representation, in the signatures of functions, is their public name."""

    __slots__ = ()

    def __repr__(self) -> str:
        return "islands.EFFECTS"


#: All effects and free forms.
EFFECTS: tuple[Effect, ...] = _Effects(_IN_ORDER)

#: Maps of an actuator whose response depends on their order.
ACTUATOR_MAPS = (
    DEAD_ZONE,
    INPUT_SATURATION,
    RATE_LIMIT,
    QUANTISED_INPUT,
    BACKLASH,
    STICTION,
    TEMPERATURE_GAIN,
)

#: Maps of a sensor whose response depends on their order with the other maps of the output.
SENSOR_MAPS = (SENSOR_HYSTERESIS, ABSOLUTE_VALUE_SENSOR, UNSIGNED_SENSOR, OUTPUT_SATURATION, CYCLIC_ERROR)

#: Effects and free forms by name.
CATALOGUE: Mapping[str, Effect] = {effect.name: effect for effect in EFFECTS}

#: Templates of the effects that exist once for each state, parameter or model of a simulation, by name.
OF_EACH: Mapping[str, EffectTemplate] = {
    template.name: template
    for template in (WRONG_PARAMETER, STATE_CLIP, STATE_RANGE, INPUT_OFFSET, OUTFLOW_LAW, MODEL_FORM)
}


def find_entry(name: str) -> Effect | EffectTemplate | None:
    """Return an effect or a template by its name, with or without a state or parameter; None if unknown."""
    cause = name.partition(":")[0]
    return CATALOGUE.get(cause) or OF_EACH.get(cause)


def get_summary(name: str) -> str:
    """Return the summary of an effect, given its name with or without a state or parameter."""
    entry = find_entry(name)
    if entry is None:
        raise KeyError(name)
    return entry.summary


def get_title(name: str) -> str:
    """Return the plain name of an effect, given its name with or without a state or parameter.

    It is empty for an effect that is not in the catalogue.
    """
    entry, place = find_entry(name), name.partition(":")[2]
    if isinstance(entry, EffectTemplate) and place and entry.placed_title:
        return entry.placed_title.format(place)
    return "" if entry is None else entry.title


def catalogue_order(effects: Iterable[Effect], known: Sequence[Effect] = ()) -> tuple[Effect, ...]:
    """Sort effects in the order in which they act: that of the catalogue, then other maps by name.

    Parameters
    ----------
    effects : iterable of Effect
    known : sequence of Effect
        Effects that keep the order in which they are given.
    """
    places = {name: place for place, name in enumerate(CATALOGUE)}

    def place(effect: Effect) -> tuple[int, str]:
        if effect.name in places:
            return places[effect.name], ""
        # Effects on parameters and states are part of the equation; their order does not matter.
        return (-1, "") if effect.form is None else (len(places), effect.name)

    ordered = sorted(effects, key=place)
    kept = iter([effect for effect in known if effect in ordered])
    return tuple(next(kept, effect) if effect in known else effect for effect in ordered)
