"""Preparation: whether a record can be analysed, which part of it, at which scales, and for which effects."""

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

#: Part of the record that nothing but the gain ever sees: its end.
LOCKED = 0.25

#: The fewest samples that are worth an analysis.
FEWEST = 200


def select_effects(
    simulator: Simulator,
    context: SimulationContext,
    tolerance: Mapping[str, float],
    catalogue: Sequence[Effect] = EFFECTS,
) -> list[Effect]:
    """Return the effects of a catalogue that can enter a simulation and that a record could show.

    Raises
    ------
    SettingsError
        Two effects of the catalogue have the same name.
    """
    names = [effect.name for effect in catalogue]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise SettingsError(
            f"effects need different names, and {', '.join(twice)} is given twice: rename one"
        )
    trusted = {each.name for each in simulator.parameters if not each.initial} <= tolerance.keys()
    effects = [
        effect
        for effect in catalogue
        if effect.site in simulator.sites
        and (effect.site != Site.CORE or effect.name in simulator.supported_effects)
        and effect.name not in simulator.built_in_effects
        and (trusted or not effect.is_gain)
        and effect.is_applicable(context)
    ]
    effects += simulator.state_effects
    return effects + [wrong_parameter(each) for each in simulator.parameters if each.name in tolerance]


def validate_prior(tolerance: Mapping[str, float], simulator: Simulator) -> Mapping[str, float]:
    """Return tolerances, once it is known that the simulation has such parameters."""
    names = [parameter.name for parameter in simulator.parameters]
    for name, value in tolerance.items():
        if name not in names:
            raise SettingsError(
                f"{simulator.name} has no parameter {name!r}: it has {', '.join(names) or 'none'}"
            )
        if not 0.0 < value < 1.0:
            raise SettingsError(f"the tolerance of {name} is a part of its value, like 0.02; got {value:g}")
    return dict(tolerance)


def estimation_part(record: Dataset) -> Dataset:
    """Return the part of a record that estimation may see: its end is locked away."""
    return record[: int((1.0 - LOCKED) * record.samples)]


def count_fitted_samples(record: Dataset) -> int:
    """Return how many samples estimation sees, once it is known that the record can be used."""
    if record.samples < FEWEST:
        raise RecordError(
            f"the record has {record.samples} samples, and a diagnosis takes {FEWEST} at least: give a "
            "longer one"
        )
    if len(record.segments) > 1:
        raise RecordError("the record is several recordings: diagnose one after the other")
    if np.isnan(record.y).any():
        raise RecordError("the measured output has gaps: repair them, or select rows without any")
    fitted = estimation_part(record).samples
    for name, signal in zip((*record.input_names, record.output_name), (*record.u.T, record.y), strict=True):
        if np.ptp(signal[:fitted]) == 0.0:
            raise RecordError(f"column {name} is constant: a diagnosis needs signals that move")
    for name, signal in zip(record.input_names[1:], record.u.T[1:], strict=True):
        if np.array_equal(signal, record.u[:, 0]):
            raise RecordError(f"channel {name} is the input itself: leave it out")
    return fitted


def make_context(record: Dataset, simulator: Simulator, fitted: int) -> SimulationContext:
    """Return what drives a simulation, and the scales of a record."""
    names, units = record.input_names, record.input_units
    context = SimulationContext(
        u=np.ascontiguousarray(record.u[:, 0]),
        dt=record.dt,
        channels={
            name: np.ascontiguousarray(record.u[:, place]) for place, name in enumerate(names) if place
        },
        units=dict(zip(names[1:], units[1:], strict=True)),
        input_peak=float(np.max(np.abs(record.u[:, 0]))),
        output_peak=1.0,
        input_unit=units[0] or "1",
        output_unit=record.output_unit or "1",
        fit_end_time=fitted * record.dt,
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
