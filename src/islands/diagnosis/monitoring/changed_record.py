"""Cause of a large change, from the record that raised the alarm.

A change of many standard deviations is outside the range in which responses are linear, and shows in a single
record: each cause is calibrated to it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.preparation import select_effects
from islands.diagnosis.inference.screening import screen_effects
from islands.diagnosis.inference.verdict import explained_fraction
from islands.diagnosis.monitoring.change_cause import ChangeCause, choose_cause
from islands.diagnosis.monitoring.effect_states import EffectStates, MonitorReference, calibrate_record
from islands.diagnosis.run import DiagnosisRun
from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import (
    BatchSimulator,
    SimulationRun,
    Simulator,
    SimulatorWrapper,
)


@dataclass(frozen=True, slots=True, eq=False)
class CentredSimulator(SimulatorWrapper, BatchSimulator):
    """Simulator whose nominal values are the means of undisturbed records, the means of their prior.

    Attributes
    ----------
    simulator : Simulator
    means : mapping
        Nominal values by the names of parameters; all others are those of the simulator.
    """

    means: Mapping[str, float]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the simulator with other nominal values."""
        return tuple(
            replace(each, nominal=self.means.get(each.name, each.nominal))
            for each in self.simulator.parameters
        )

    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate the outputs of several runs, at once if the simulator can."""
        return self.simulator.simulate_batch(runs, context, every)


def explain_record(
    record: Dataset,
    simulator: Simulator,
    tolerance: Mapping[str, float],
    reference: MonitorReference,
    undisturbed: Sequence[EffectStates],
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
    reference : MonitorReference
    undisturbed : sequence of EffectStates
        States of the records before the change.
    """
    centred = CentredSimulator(simulator, _find_means(reference, undisturbed))
    free, target = calibrate_record(record, centred, tolerance, reference.noise)
    effects = select_effects(simulator, free.simulation.context, target.prior_std)
    spreads = _find_spreads(reference, undisturbed, centred.means)
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
    for screened in screen_effects(base, held, DiagnosisRun(effects)):
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


def _find_means(reference: MonitorReference, undisturbed: Sequence[EffectStates]) -> dict[str, float]:
    means = np.mean([each.values for each in undisturbed], axis=0)
    return {each.name: float(mean) for each, mean in zip(reference.parameters, means, strict=True)}


def _find_spreads(
    reference: MonitorReference, undisturbed: Sequence[EffectStates], means: Mapping[str, float]
) -> dict[str, float]:
    """Return the standard deviation of each parameter from record to record, relative to its mean."""
    spreads = {}
    for index, parameter in enumerate(reference.parameters):
        if mean := means[parameter.name]:
            spread = float(np.std([each.values[index] for each in undisturbed], ddof=1) / abs(mean))
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
