"""Search for gross errors of a record: a few discrete corrections, each compared with the record as given."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    evaluate_fit,
    prior_precision,
)
from islands.discrepancy.calibration.noise_model import estimate_effective_samples
from islands.discrepancy.calibration.preparation import make_context, make_target
from islands.discrepancy.calibration.target import Target
from islands.discrepancy.gross_errors.channel_corrections import correct_swapped_channels
from islands.discrepancy.gross_errors.correction import Correction
from islands.discrepancy.gross_errors.gross_error import GrossError
from islands.discrepancy.gross_errors.scale_corrections import (
    correct_input_unit,
    correct_output_unit,
    correct_sampling_time,
    correct_sign,
)
from islands.discrepancy.gross_errors.time_offset import correct_time_offset
from islands.discrepancy.interfaces.effect import Signal
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.errors import RecordError

#: Makes the corrections of a record; receives the record, the simulated output and the fitted samples.
Check = Callable[[Dataset, Signal, int], Iterable[Correction]]

#: Checks, in the order in which equally good corrections are listed. To add a check, add an entry.
CHECKS: tuple[Check, ...] = (
    lambda record, _simulated, _fitted: correct_sampling_time(record),
    lambda record, _simulated, _fitted: correct_output_unit(record),
    lambda record, _simulated, _fitted: correct_input_unit(record),
    lambda record, _simulated, _fitted: correct_sign(record),
    lambda record, _simulated, _fitted: correct_swapped_channels(record),
    correct_time_offset,
)

#: Errors below, relative to the standard deviation of the output, are not gross.
MIN_ERROR = 0.1

#: Largest relative error of a corrected simulation.
MAX_CORRECTED_ERROR = 0.3

#: The same if another channel is the output. A simulation often resembles its own input.
MAX_EXCHANGED_ERROR = 0.1

#: Largest error of a corrected simulation, relative to that of the calibrated simulation as given.
MAX_ERROR_RATIO = 0.3

#: Largest deviation of a parameter from its nominal value, in tolerances, without an error.
MAX_DEVIATION = 4.0

#: Steps in which initial states are fitted before corrections are compared.
STATE_ITERATIONS = 3

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
    fitted: int,
    prior_std: Mapping[str, float],
) -> tuple[GrossError, ...]:
    """Return the gross errors that explain nearly all of a large misfit, the best first; usually none.

    Several are returned if the record cannot distinguish them.

    Parameters
    ----------
    base : CalibrationResult or None
        The simulation as given, calibrated; None if it diverges.
    fitted : int
        Number of samples used for estimation.
    prior_std : mapping
        Relative standard deviations of the simulator's parameters about their nominal values.
    """
    target = make_target(record, fitted, prior_std)
    error_before, free_error, nominal = DIVERGED, DIVERGED, np.full(record.samples, np.nan)
    if base is not None:
        error_before = relative_error(limit_to_tolerances(base, target), target)
        if not error_before > MIN_ERROR:
            return _explain_negative_parameters(record, base, error_before)
        free_error = _compute_free_error(base, target)
        nominal = base.simulation.simulate(base.simulation.nominal)
    found = []
    for check in CHECKS:
        for simulation, start, corrected, correction in _select(
            check(record, nominal, fitted), simulator, target, nominal, fitted
        ):
            fit = limit_to_tolerances(calibrate(simulation, corrected, start), corrected)
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
    fitted: int,
    prior_std: Mapping[str, float],
) -> RecordError:
    """Return the error of a simulation that diverges, with the gross error of the record that explains it."""
    found = find_gross_errors(record, simulator, None, fitted, prior_std)
    if not found:
        return error
    correction = found[0].correction
    return RecordError(f"{error}. {correction.description} {correction.advice}")


def relative_error(fit: CalibrationResult, target: Target) -> float:
    """Return the RMS error of a fit relative to the standard deviation of the output."""
    deviation = float(np.std(target.y[target.estimation_part]))
    return float(np.sqrt(fit.mean_square)) / deviation if deviation > 0.0 else float("inf")


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
    corrections: Iterable[Correction], simulator: Simulator, target: Target, nominal: Signal, fitted: int
) -> Sequence[tuple[ExtendedSimulator, Signal, Target, Correction]]:
    """Return the best corrections that change something, each with its simulation, start and target.

    They are compared at the nominal parameters; initial states are fitted.
    """
    rated = []
    for correction in corrections:
        made = _prepare(correction, simulator, target, fitted)
        if made is None:
            continue
        simulation, start, corrected = made
        if np.array_equal(corrected.y, target.y, equal_nan=True) and np.array_equal(
            simulation.simulate(start), nominal
        ):
            continue
        is_fixed = np.array([not parameter.initial for parameter in simulation.parameters], dtype=bool)
        fit = (
            evaluate_fit(simulation, corrected, start)
            if is_fixed.all()
            else calibrate(simulation, corrected, start, STATE_ITERATIONS, is_fixed)
        )
        error = relative_error(fit, corrected)
        if error < MAX_UNCALIBRATED_ERROR:
            rated.append((error, (simulation, fit.values, corrected, correction)))
    rated.sort(key=lambda each: each[0])
    return [made for _, made in rated[:CALIBRATED]]


def _prepare(
    correction: Correction, simulator: Simulator, target: Target, fitted: int
) -> tuple[ExtendedSimulator, Signal, Target] | None:
    """Return simulation, starting point and target of a correction; None if the simulation diverges."""
    record = correction.record
    try:
        context = make_context(record, simulator, fitted)
    except RecordError:
        return None
    simulation = ExtendedSimulator(simulator, (), context)
    # A nominal initial state may come from the record as given.
    is_state = np.array([parameter.initial for parameter in simulation.parameters], dtype=bool)
    start = np.where(is_state, correction.scale, 1.0) * simulation.nominal
    is_used = np.arange(record.samples) < fitted - max(correction.shift, 0)
    made = make_target(record, fitted, target.prior_std)
    part = made.estimation_part & correction.is_known & is_used
    return simulation, start, replace(made, estimation_part=part)


def _compute_free_error(base: CalibrationResult, target: Target) -> float:
    """Return the relative error of the simulation as given, calibrated within its bounds alone."""
    free = replace(target, prior_std={})
    return relative_error(calibrate(base.simulation, free, base.values), free)
