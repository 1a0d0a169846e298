"""Simulation of a corrected record, which is calibrated as that of the record as given."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    evaluate_fit,
    prior_precision,
)
from islands.diagnosis.calibration.preparation import make_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.gross_errors.correction import Correction
from islands.effects.interface.context import Signal
from islands.errors import RecordError
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator

Computed = TypeVar("Computed")

#: Largest deviation of a parameter from its nominal value, in tolerances, without an error.
MAX_DEVIATION = 4.0

#: Steps in which initial states are fitted before corrections are compared.
STATE_ITERATIONS = 3


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedSimulation:
    """Simulation of a corrected record.

    The simulation may fail on a record with a wrong correction. There is no fit then, and the correction is
    rejected.

    Attributes
    ----------
    correction : Correction
    simulation : ExtendedSimulator
    start : ndarray, shape (parameters,)
        Values from which the simulation is calibrated.
    target : Target
    """

    correction: Correction
    simulation: ExtendedSimulator
    start: Signal
    target: Target

    def simulate(self) -> Signal | None:
        """Simulate the corrected record from the start; None if the simulation fails."""
        return _try(lambda: self.simulation.simulate(self.start))

    def fit_states(self) -> CalibrationResult | None:
        """Fit the initial states in a few steps; None if the simulation fails."""
        is_fixed = np.array([not parameter.initial for parameter in self.simulation.parameters], dtype=bool)
        if is_fixed.all():
            return _try(lambda: evaluate_fit(self.simulation, self.target, self.start))
        return _try(lambda: calibrate(self.simulation, self.target, self.start, STATE_ITERATIONS, is_fixed))

    def calibrate(self) -> CalibrationResult | None:
        """Calibrate the simulation within its tolerances; None if the simulation fails."""
        return _try(
            lambda: limit_to_tolerances(calibrate(self.simulation, self.target, self.start), self.target)
        )


def make_corrected_simulation(
    correction: Correction, simulator: Simulator, target: Target
) -> CorrectedSimulation | None:
    """Return the simulation of a corrected record; None if it fails or diverges.

    Parameters
    ----------
    target : Target
        Target of the record as given.
    """
    record, fitted = correction.record, target.fitted
    context = _try(lambda: make_context(record, simulator, fitted))
    if context is None:
        return None
    simulation = ExtendedSimulator(simulator, (), context)
    # A nominal initial state may come from the record as given.
    is_state = np.array([parameter.initial for parameter in simulation.parameters], dtype=bool)
    start = np.where(is_state, correction.scale, 1.0) * simulation.nominal
    is_used = np.arange(record.samples) < fitted - max(correction.shift, 0)
    made = make_target(record, fitted, target.prior_std)
    part = made.estimation_part & correction.is_known & is_used
    return CorrectedSimulation(correction, simulation, start, replace(made, estimation_part=part))


def limit_to_tolerances(fit: CalibrationResult, target: Target) -> CalibrationResult:
    """Return a fit whose parameters deviate by at most `MAX_DEVIATION` tolerances from their nominal values.

    A long record outweighs any prior. A parameter that would have to leave its tolerance by far is evidence
    of an error.
    """
    inverse_std, nominal = prior_precision(fit.simulation, target.prior_std)
    with np.errstate(divide="ignore"):
        reach = MAX_DEVIATION / inverse_std
    values = np.clip(fit.values, nominal - reach, nominal + reach)
    is_limited = values != fit.values
    if not is_limited.any():
        return fit
    # Their priors would move them; those of the other parameters remain.
    limited = {fit.simulation.parameters[place].name for place in np.flatnonzero(is_limited)}
    remaining = {name: std for name, std in target.prior_std.items() if name not in limited}
    others = replace(target, prior_std=remaining)
    refitted = calibrate(fit.simulation, others, values, is_fixed=is_limited)
    return evaluate_fit(fit.simulation, target, refitted.values)


def _try(compute: Callable[[], Computed]) -> Computed | None:
    """Return a result, or None if the simulation fails on the record."""
    try:
        return compute()
    except RecordError:
        return None
