"""Cause of a large change, from the record that raised the alarm.

A change of many standard deviations is outside the range in which responses are linear, and shows in a single
record: each cause is calibrated to it.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.discrepancy.calibration.preparation import select_effects
from islands.discrepancy.inference.screening import screen_effects
from islands.discrepancy.inference.verdict import explained_fraction
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.monitoring.change_cause import ChangeCause, choose_cause
from islands.discrepancy.monitoring.effect_states import EffectStates, Reference, calibrate_record
from islands.discrepancy.simulators.extended import ExtendedSimulator


def explain_record(
    record: Dataset,
    simulator: Simulator,
    tolerance: Mapping[str, float],
    reference: Reference,
    undisturbed: list[EffectStates],
) -> ChangeCause:
    """Calibrate each cause to a changed record and return the best one.

    All parameters of the simulation have the spread of the undisturbed records as their prior, except the
    one that is supposed to have changed.

    Parameters
    ----------
    record : Dataset
    simulator : Simulator
    tolerance : mapping
        Relative standard deviations of parameters, by which the effects are selected.
    reference : Reference
    undisturbed : list of EffectStates
        States of the records before the change.
    """
    free, target = calibrate_record(record, simulator, tolerance, reference.noise)
    effects = select_effects(simulator, free.simulation.context, target.prior_std)
    spreads = _find_spreads(reference, undisturbed)
    simulation = free.simulation
    held = replace(target, prior_std=spreads)
    base = calibrate(simulation, held, simulation.nominal)
    is_fixed = np.array([not each.initial for each in simulation.parameters], dtype=bool)
    unchanged = calibrate(simulation, held, simulation.nominal, is_fixed=is_fixed)
    floor = float(np.mean([each.rmse**2 for each in undisturbed]))
    penalty = float(np.log(base.noise.effective_samples))
    causes = []
    for name in spreads:
        others = {each: spread for each, spread in spreads.items() if each != name}
        fit = calibrate(simulation, replace(target, prior_std=others), base.values)
        gain = base.score - fit.score - penalty
        causes.append(ChangeCause(name, True, gain, explained_fraction(unchanged, fit, floor), ()))
    for screened in screen_effects(base, held, effects):
        fit = screened.fit
        causes.append(
            ChangeCause(
                screened.effect.name,
                False,
                screened.score_gain(base),
                explained_fraction(unchanged, fit, floor),
                (),
                _describe_strength(fit),
            )
        )
    return choose_cause(causes)


def _find_spreads(reference: Reference, undisturbed: list[EffectStates]) -> dict[str, float]:
    """Return the standard deviation of each parameter about its nominal value, relative to that."""
    spreads = {}
    for index, parameter in enumerate(reference.parameters):
        if parameter.nominal:
            values = np.array([each.values[index] for each in undisturbed])
            spread = float(np.sqrt(np.mean((values - parameter.nominal) ** 2)) / abs(parameter.nominal))
            spreads[parameter.name] = max(spread, 1e-9)
    return spreads


def _describe_strength(fit: CalibrationResult) -> tuple[tuple[str, float, str], ...]:
    simulation: ExtendedSimulator = fit.simulation
    part = simulation.get_slice(simulation.effects[-1])
    return tuple(
        (each.name, float(value), each.unit)
        for each, value in zip(simulation.parameters[part], fit.values[part], strict=True)
        if not each.initial
    )
