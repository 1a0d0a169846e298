"""Preparation of a diagnosis: checks of the record and of the tolerances, applicable effects, target."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from islands.diagnosis.calibration.resolution import measure_resolution
from islands.diagnosis.calibration.target import Target
from islands.effects.catalogue import EFFECTS
from islands.effects.interface.context import SimulationContext
from islands.effects.interface.effect import Effect, Site
from islands.effects.scale import wrong_parameter
from islands.errors import RecordError, SettingsError, check_type, suggest
from islands.records.dataset import Dataset
from islands.records.magnitudes import check_magnitudes
from islands.records.segments import is_resting, split_at_gaps
from islands.records.split import MIN_RECORDING_SAMPLES, estimation_part
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import Simulator

#: Minimum number of samples of a record, in all recordings together.
MIN_SAMPLES = 200

#: Families of effects on the output that are visible while the simulated output rests.
_FAMILIES_AT_REST = ("baseline", "memory", "disturbance")


def select_effects(
    simulator: Simulator,
    context: SimulationContext,
    tolerance: Mapping[str, float],
    catalogue: Sequence[Effect] = EFFECTS,
    free: bool = False,
) -> list[Effect]:
    """Return the effects to search for, or the free forms that they are compared with.

    They are the effects of the catalogue that the simulator supports and the record can show, the effects on
    the states of the simulator, and a wrong value of each parameter with a tolerance. Effects already
    modelled by the simulator are left out, as are gains unless every parameter except initial states has a
    tolerance.

    Parameters
    ----------
    free : bool
        Whether to return the free forms of the catalogue instead of all other effects.

    Raises
    ------
    SettingsError
        Two effects of the catalogue have the same name.
    """
    _check_names(catalogue)
    has_full_prior = {each.name for each in simulator.parameters if not each.initial} <= tolerance.keys()
    is_visible = _make_visibility_test(simulator, context)
    effects = [
        effect
        for effect in catalogue
        if effect.is_free == free
        and _can_extend(simulator, effect)
        and (has_full_prior or not effect.is_gain)
        and effect.is_applicable(context)
        and is_visible(effect)
    ]
    if free:
        return effects
    effects += [effect for effect in simulator.state_effects if effect.is_applicable(context)]
    return effects + [wrong_parameter(each) for each in simulator.parameters if each.name in tolerance]


def _check_names(catalogue: Sequence[Effect]) -> None:
    for effect in catalogue:
        check_type(effect, Effect, "effects", "take entries of islands.EFFECTS by their attribute name")
    names = [effect.name for effect in catalogue]
    if duplicates := sorted({name for name in names if names.count(name) > 1}):
        raise SettingsError(
            f"effects need different names, and {', '.join(duplicates)} is given twice: rename one"
        )


def _can_extend(simulator: Simulator, effect: Effect) -> bool:
    """Return whether an effect acts where the simulator admits it, and is not part of the simulator."""
    is_supported = effect.site != Site.CORE or effect.name in simulator.supported_effects
    return effect.site in simulator.sites and is_supported and effect.name not in simulator.built_in_effects


def _make_visibility_test(simulator: Simulator, context: SimulationContext) -> Callable[[Effect], bool]:
    """Return the test whether an input that rests over the estimation part can show an effect.

    Effects at a constant input are constants, as an offset is. If the simulated output rests as well, only
    effects on the baseline, memories and disturbances of the output are visible.
    """
    if not context.has_resting_input:
        return lambda _: True
    fitted = round(context.fit_end_time / context.dt)
    simulation = ExtendedSimulator(simulator, (), context)
    if is_resting(simulation.simulate(simulation.nominal)[:fitted]):
        return lambda effect: effect.site == Site.OUTPUT and effect.family in _FAMILIES_AT_REST
    has_output_coordinate = context.force_coordinate.is_dissipative
    return lambda effect: effect.site != Site.INPUT and (effect.site != Site.FORCE or has_output_coordinate)


def validate_prior(tolerance: Mapping[str, float], simulator: Simulator) -> Mapping[str, float]:
    """Return a copy of the tolerances after checking them.

    Raises
    ------
    SettingsError
        A tolerance is not between 0 and 1, or the simulator has no such parameter, or its value is 0.
    """
    nominal = {parameter.name: parameter.nominal for parameter in simulator.parameters}
    for name, value in tolerance.items():
        if name not in nominal:
            raise SettingsError(
                f"{simulator.name} has no parameter {name!r}: it has {', '.join(nominal) or 'none'}"
                f"{suggest(name, nominal)}"
            )
        if not 0.0 < value < 1.0:
            raise SettingsError(
                f"the tolerance of {name} is a fraction of its value, such as 0.02; got {value:g}"
            )
        if nominal[name] == 0.0:
            raise SettingsError(
                f"the tolerance of {name} is a fraction of its value, which is 0: leave the tolerance out"
            )
    return dict(tolerance)


def count_fitted_samples(record: Dataset) -> int:
    """Return the number of samples used for estimation, after checking that the record is usable.

    Raises
    ------
    RecordError
        The record or one of its recordings is too short, or has too few outputs or a constant one, or a
        magnitude is too large or too small to calculate with.
    """
    if record.samples < MIN_SAMPLES:
        raise RecordError(
            f"the record has {record.samples} samples, and a diagnosis needs at least {MIN_SAMPLES}: give a "
            "longer one"
        )
    if (used := record.samples - record.held_out) < MIN_SAMPLES:
        raise RecordError(
            f"the recordings that are not held out have {used} samples, and a diagnosis needs at least "
            f"{MIN_SAMPLES}: give longer ones"
        )
    if len(record.segments) > 1 and (shortest := min(record.segments)) < MIN_RECORDING_SAMPLES:
        raise RecordError(
            f"recording {1 + record.segments.index(shortest)} has {shortest} samples, and a diagnosis of "
            f"several recordings needs at least {MIN_RECORDING_SAMPLES} of each: leave it out"
        )
    estimation = estimation_part(record)
    check_magnitudes(estimation, record)
    fitted = estimation.samples
    is_known = ~np.isnan(record.y)
    if (known := int(is_known.sum())) < MIN_SAMPLES:
        raise RecordError(
            f"the output has {known} values in {record.samples} samples, and a diagnosis needs at least "
            f"{MIN_SAMPLES}: repair its gaps, or give a longer record"
        )
    for first, last in (*record.bounds, (0, fitted), (fitted, record.samples)):
        if (known := int(is_known[first:last].sum())) < MIN_RECORDING_SAMPLES:
            raise RecordError(
                f"the output has {known} values from sample {first} to sample {last - 1}, and a diagnosis "
                f"needs at least {MIN_RECORDING_SAMPLES}: repair its gaps, or select other rows"
            )
    if np.ptp(record.y[:fitted][is_known[:fitted]]) == 0.0:
        raise RecordError(f"column {record.output_name} is constant: a diagnosis needs an output that varies")
    return fitted


def make_target(record: Dataset, fitted: int, prior_std: Mapping[str, float]) -> Target:
    """Return the target of a calibration; missing outputs are not part of it."""
    is_known = ~np.isnan(record.y)
    is_fitted = is_known & (np.arange(record.samples) < fitted)
    segments = split_at_gaps(is_known, record.segments)
    resolution = measure_resolution(record.y[:fitted])
    return Target(
        *(record.y, is_fitted, None, prior_std), segments=segments, fitted=fitted, resolution=resolution
    )
