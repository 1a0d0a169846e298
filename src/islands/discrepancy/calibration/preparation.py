"""Preparation of a diagnosis: checks of the record, estimation part, context and applicable effects."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.effects import EFFECTS
from islands.discrepancy.effects.scale import wrong_parameter
from islands.discrepancy.interfaces.effect import Effect, SimulationContext, Site
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.coordinates import peak_amplitude
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.errors import RecordError, SettingsError

#: Fraction of the record, at its end, that is reserved for hold-out validation.
HOLDOUT_FRACTION = 0.25

#: Minimum number of samples of a record, in all recordings together.
MIN_SAMPLES = 200

#: Minimum number of samples of each of several recordings, and of each part of one that the hold-out part
#: divides: its initial state is estimated from them.
MIN_RECORDING_SAMPLES = 20


def select_effects(
    simulator: Simulator,
    context: SimulationContext,
    tolerance: Mapping[str, float],
    catalogue: Sequence[Effect] = EFFECTS,
) -> list[Effect]:
    """Return the effects to search for.

    They are the effects of the catalogue that the simulator supports and the record can show, the effects on
    the states of the simulator, and a wrong value of each parameter with a tolerance. Effects already
    modelled by the simulator are left out, as are gains unless every parameter except initial states has a
    tolerance.

    Raises
    ------
    SettingsError
        Two effects of the catalogue have the same name.
    """
    names = [effect.name for effect in catalogue]
    if duplicates := sorted({name for name in names if names.count(name) > 1}):
        raise SettingsError(
            f"effects need different names, and {', '.join(duplicates)} is given twice: rename one"
        )
    has_full_prior = {each.name for each in simulator.parameters if not each.initial} <= tolerance.keys()
    effects = [
        effect
        for effect in catalogue
        if effect.site in simulator.sites
        and (effect.site != Site.CORE or effect.name in simulator.supported_effects)
        and effect.name not in simulator.built_in_effects
        and (has_full_prior or not effect.is_gain)
        and effect.is_applicable(context)
    ]
    effects += simulator.state_effects
    return effects + [wrong_parameter(each) for each in simulator.parameters if each.name in tolerance]


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


def estimation_part(record: Dataset) -> Dataset:
    """Return the part of a record that is used for estimation, without the hold-out part at its end.

    The hold-out part may consist of whole recordings. It begins with a recording if less than
    `MIN_RECORDING_SAMPLES` would be divided from one.
    """
    fitted = int((1.0 - HOLDOUT_FRACTION) * record.samples)
    for boundary, _ in record.bounds[1:]:
        if abs(fitted - boundary) < MIN_RECORDING_SAMPLES:
            fitted = boundary
            break
    return record[:fitted]


def count_fitted_samples(record: Dataset) -> int:
    """Return the number of samples used for estimation, after checking that the record is usable.

    Raises
    ------
    RecordError
        The record or one of its recordings is too short, or has gaps, a constant signal or a channel equal to
        the input.
    """
    if record.samples < MIN_SAMPLES:
        raise RecordError(
            f"the record has {record.samples} samples, and a diagnosis needs at least {MIN_SAMPLES}: give a "
            "longer one"
        )
    if len(record.segments) > 1 and (shortest := min(record.segments)) < MIN_RECORDING_SAMPLES:
        raise RecordError(
            f"recording {1 + record.segments.index(shortest)} has {shortest} samples, and a diagnosis of "
            f"several recordings needs at least {MIN_RECORDING_SAMPLES} of each: leave it out"
        )
    if np.isnan(record.y).any():
        raise RecordError("the measured output has gaps: repair them, or select rows without any")
    fitted = estimation_part(record).samples
    for name, signal in zip((*record.input_names, record.output_name), (*record.u.T, record.y), strict=True):
        if np.ptp(signal[:fitted]) == 0.0:
            raise RecordError(f"column {name} is constant: a diagnosis needs signals that vary")
    for name, signal in zip(record.input_names[1:], record.u.T[1:], strict=True):
        if np.array_equal(signal, record.u[:, 0]):
            raise RecordError(f"channel {name} is the input itself: leave it out")
    return fitted


def make_context(record: Dataset, simulator: Simulator, fitted: int) -> SimulationContext:
    """Make the context of a simulation: its input, and the scales of the record.

    Parameters
    ----------
    fitted : int
        Number of samples used for estimation.

    Raises
    ------
    RecordError
        The simulation diverges on the input.
    """
    names, units = record.input_names, record.input_units
    context = SimulationContext(
        u=np.ascontiguousarray(record.u[:, 0]),
        dt=record.dt,
        channels={
            name: np.ascontiguousarray(record.u[:, index]) for index, name in enumerate(names) if index
        },
        units=dict(zip(names[1:], units[1:], strict=True)),
        input_peak=float(np.max(np.abs(record.u[:, 0]))),
        output_peak=1.0,
        input_unit=units[0] or "1",
        output_unit=record.output_unit or "1",
        fit_end_time=fitted * record.dt,
        segments=record.segments,
    )
    simulation = ExtendedSimulator(simulator, (), context)
    nominal = simulation.simulate(simulation.nominal)
    if not np.isfinite(nominal).all():
        raise RecordError(
            f"the simulation {simulator.name} diverges on this input: check its parameters, its units and "
            "the sampling time"
        )
    scaled = replace(context, output_peak=peak_amplitude(nominal))
    return replace(scaled, force_coordinate=simulator.make_force_coordinate(scaled, nominal))
