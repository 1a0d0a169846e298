"""Search for gross errors of a record: a few discrete corrections, each compared with the record as given."""

from collections.abc import Callable, Iterable, Sequence, Set
from dataclasses import replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.gross_errors.channel_corrections import correct_swapped_channels
from islands.diagnosis.gross_errors.corrected_simulation import (
    CorrectedSimulation,
    limit_to_tolerances,
    make_corrected_simulation,
)
from islands.diagnosis.gross_errors.correction import Correction
from islands.diagnosis.gross_errors.explanation import GrossError
from islands.diagnosis.gross_errors.scale_corrections import (
    correct_input_unit,
    correct_output_unit,
    correct_sampling_time,
    correct_sign,
)
from islands.diagnosis.gross_errors.time_offset import correct_time_offset
from islands.effects.interface.context import Signal
from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.records.noise_model import estimate_effective_samples
from islands.simulators.interface import Simulator

#: Makes the corrections of a record; receives the record, the names of the channels that the simulation
#: reads, the simulated output and the fitted samples.
Check = Callable[[Dataset, Set[str], Signal, int], Iterable[Correction]]

#: Checks, in the order in which equally good corrections are listed. To add a check, add an entry.
CHECKS: tuple[Check, ...] = (
    lambda record, _read, _simulated, _fitted: correct_sampling_time(record),
    lambda record, _read, _simulated, _fitted: correct_output_unit(record),
    lambda record, read, _simulated, _fitted: correct_input_unit(record, read),
    lambda record, read, _simulated, _fitted: correct_sign(record, read),
    lambda record, read, _simulated, _fitted: correct_swapped_channels(record, read),
    lambda record, _read, simulated, fitted: correct_time_offset(record, simulated, fitted),
)

#: Errors below, relative to the standard deviation of the output, are not gross.
MIN_ERROR = 0.1

#: Largest relative error of a corrected simulation.
MAX_CORRECTED_ERROR = 0.3

#: The same if another channel is the output. A simulation often resembles its own input.
MAX_EXCHANGED_ERROR = 0.1

#: Largest error of a corrected simulation, relative to that of the calibrated simulation as given.
MAX_ERROR_RATIO = 0.3

#: Number of corrections of each check that are calibrated.
CALIBRATED = 3

#: Relative error of a correction before its calibration above which it is not calibrated.
MAX_UNCALIBRATED_ERROR = 3.0

#: Relative error of a simulation that diverges.
DIVERGED = 1e6

#: Corrections whose scores are within this margin of the best one cannot be distinguished from it.
EQUIVALENCE_MARGIN = 9.0


def find_gross_errors(
    record: Dataset,
    simulator: Simulator,
    base: CalibrationResult | None,
    target: Target,
) -> tuple[GrossError, ...]:
    """Return the gross errors that explain nearly all of a large misfit, the best first; usually none.

    Several are returned if the record cannot distinguish them.

    Parameters
    ----------
    base : CalibrationResult or None
        The simulation as given, calibrated; None if it diverges.
    target : Target
        Target of the record as given.
    """
    error_before, free_error, nominal = DIVERGED, DIVERGED, np.full(record.samples, np.nan)
    if base is not None:
        error_before = relative_error(limit_to_tolerances(base, target), target)
        if not error_before > MIN_ERROR:
            return _explain_negative_parameters(record, base, error_before)
        free_error = _compute_free_error(base, target)
        nominal = base.simulation.simulate(base.simulation.nominal)
    found = []
    read = simulator.read_channels
    for check in CHECKS:
        for candidate in _select(check(record, read, nominal, target.fitted), simulator, target, nominal):
            if (fit := candidate.calibrate()) is None:
                continue
            correction, corrected = candidate.correction, candidate.target
            error = relative_error(fit, corrected)
            before = error_before if correction.is_discrete else min(error_before, free_error)
            largest = MAX_EXCHANGED_ERROR if correction.has_other_output else MAX_CORRECTED_ERROR
            if error < min(largest, MAX_ERROR_RATIO * before):
                found.append((correction, fit, corrected, error))
    if not found:
        return ()
    _, fit, best_target, _ = min(found, key=lambda each: each[-1])
    samples = estimate_effective_samples(best_target.residual(fit.output), best_target.fitted_segments)
    errors = [
        GrossError(
            correction,
            fit,
            error,
            error_before,
            # A column of the simulation may be a column of the record: no error remains.
            2.0 * samples * float(np.log(max(error, np.finfo(float).tiny) / error_before)) + fit.penalty,
        )
        for correction, fit, _, error in found
    ]
    errors.sort(key=lambda each: round(each.cost))
    return tuple(each for each in errors if each.cost < errors[0].cost + EQUIVALENCE_MARGIN)


def explain_divergence(
    error: RecordError,
    record: Dataset,
    simulator: Simulator,
    target: Target,
) -> RecordError:
    """Return the error of a simulation that diverges, with the gross error of the record that explains it."""
    found = find_gross_errors(record, simulator, None, target)
    if not found:
        return error
    correction = found[0].correction
    return RecordError(f"{error}. {correction.description} {correction.advice}")


def relative_error(fit: CalibrationResult, target: Target) -> float:
    """Return the RMS error of a fit relative to the standard deviation of the output."""
    deviation = float(np.std(target.y[target.estimation_part]))
    return float(np.sqrt(fit.mean_square)) / deviation if deviation > 0.0 else float("inf")


def _explain_negative_parameters(
    record: Dataset, base: CalibrationResult, error: float
) -> tuple[GrossError, ...]:
    """Return a flipped sign if all parameters that have to be positive are negative; otherwise nothing."""
    is_positive = np.array([parameter.is_positive for parameter in base.simulation.parameters], dtype=bool)
    if not is_positive.any() or (base.values[is_positive] >= 0.0).any():
        return ()
    names = ", ".join(parameter.name for parameter in base.simulation.parameters if parameter.is_positive)
    correction = next(iter(correct_sign(record)))
    correction = replace(
        correction, description=f"The calibrated {names} are all negative. {correction.description}"
    )
    # With the opposite parameters, the output is the opposite one.
    fit = replace(base, values=np.where(is_positive, -base.values, base.values), output=-base.output)
    return (GrossError(correction, fit, error, error, 0.0),)


def _select(
    corrections: Iterable[Correction], simulator: Simulator, target: Target, nominal: Signal
) -> Sequence[CorrectedSimulation]:
    """Return the simulations of the best corrections that change something, from their fitted initial states.

    They are compared at the nominal parameters.
    """
    rated = []
    for correction in corrections:
        candidate = make_corrected_simulation(correction, simulator, target)
        if candidate is None or _changes_nothing(candidate, target, nominal):
            continue
        fit = candidate.fit_states()
        if fit is not None and (error := relative_error(fit, candidate.target)) < MAX_UNCALIBRATED_ERROR:
            rated.append((error, replace(candidate, start=fit.values)))
    rated.sort(key=lambda each: each[0])
    return [candidate for _, candidate in rated[:CALIBRATED]]


def _changes_nothing(candidate: CorrectedSimulation, target: Target, nominal: Signal) -> bool:
    """Return whether a correction changes neither the output nor the simulation."""
    if not np.array_equal(candidate.target.y, target.y, equal_nan=True):
        return False
    simulated = candidate.simulate()
    return simulated is not None and np.array_equal(simulated, nominal)


def _compute_free_error(base: CalibrationResult, target: Target) -> float:
    """Return the relative error of the simulation as given, calibrated within its bounds alone."""
    free = replace(target, prior_std={})
    return relative_error(calibrate(base.simulation, free, base.values), free)
