"""Functions of the time in recordings that are held out.

A drift of a sensor, a jump of its zero or the phase of a disturbance belongs to the time of a recording. Time
runs on into a recording for validation, which may have been measured much later, or after a reset.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from islands.diagnosis.calibration.initial_states import fit_initial_states
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, evaluate_fit
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.holdout import bound_reduction
from islands.diagnosis.inference.screening import transfer_parameters
from islands.records.dataset import Dataset


def leave_out_contradicted_time(
    record: Dataset,
    fit: CalibrationResult,
    target: Target,
    rng: np.random.Generator,
    coefficients: Sequence[str] = (),
) -> CalibrationResult:
    """Return a fit whose output of validation recordings has no functions of time, if these contradict them.

    The output of the recordings that are fitted, the values and the simulation remain.

    Parameters
    ----------
    record : Dataset
    fit : CalibrationResult
        With the initial states of all recordings.
    target : Target
    rng : Generator
    coefficients : sequence of str
        Parameters of the simulation that are factors of terms with the time.

    Returns
    -------
    CalibrationResult
        ``fit`` itself if it has no functions of time, if they do not increase the error significantly, or if
        no recordings are held out as a whole: time runs on within a recording.
    """
    simulation, fitted = fit.simulation, target.fitted
    remaining = [effect for effect in simulation.effects if not effect.depends_on_time]
    if not record.held_out or (len(remaining) == len(simulation.effects) and not coefficients):
        return fit
    others = simulation.with_effects(remaining)
    values = transfer_parameters(fit.values, simulation, others)
    values[[parameter.name in coefficients for parameter in others.parameters]] = 0.0
    without = fit_initial_states(evaluate_fit(others, target, values), target, fitted)
    is_known = ~np.isnan(target.y[fitted:])
    before, after = ((target.y - each.output)[fitted:][is_known] for each in (fit, without))
    if not np.isfinite(after).all() or not bound_reduction(before, after, rng)[0] > 0.0:
        return fit
    return with_held_out_output(fit, without, fitted)


def with_held_out_output(fit: CalibrationResult, other: CalibrationResult, fitted: int) -> CalibrationResult:
    """Return a fit with the output of another one from sample ``fitted`` on."""
    return replace(fit, output=np.concatenate([fit.output[:fitted], other.output[fitted:]]))
