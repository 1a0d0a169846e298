"""Hold-out validation: errors of a simulation with and without effects on samples that were not fitted."""

from dataclasses import dataclass, replace
from math import frexp

import numpy as np

from islands.diagnosis.calibration.initial_states import fit_initial_states
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.target import Target
from islands.effects.interface.context import Signal
from islands.records.dataset import Dataset
from islands.records.segments import find_bounds

#: Number of blocks into which the estimation part and the hold-out part are each divided. Blocks are the
#: units of the bootstrap and the cross-validation. They sum squared errors, so that one may contain the
#: boundary of two recordings.
BLOCKS = 36

#: Number of folds of the cross-validation.
FOLDS = 3

#: Number of bootstrap samples.
BOOTSTRAP_SAMPLES = 1000

#: Quantile of the bootstrapped gain that serves as its lower bound.
LOWER_QUANTILE = 0.05

#: Net gain above which the bootstrap may be skipped, in minus twice the log-likelihood. An event such as a
#: clipped peak falls into few blocks, and a bootstrap sample may contain none of them.
MIN_EVENT_GAIN = 20.0

#: Ratio of the total loss to the total gain of the blocks, below which the bootstrap may be skipped.
MAX_LOSS_FRACTION = 0.1


@dataclass(frozen=True, slots=True)
class ErrorMetrics:
    """Errors of a simulation: RMSE in the output's unit, MAPE in percent of its range (equation 7)."""

    rmse: float
    mape: float


@dataclass(frozen=True, slots=True)
class HoldoutGain:
    """Errors over the hold-out part of a record.

    Attributes
    ----------
    before, after, noise_floor : ErrorMetrics
        Errors of the simulation calibrated without the effects, of the one with them, and of noise alone (an
        upper bound).
    reduction_percent : float
        Reduction of the RMSE.
    ci95 : tuple of float
        95 % confidence interval of the reduction, from a block bootstrap.
    """

    before: ErrorMetrics
    after: ErrorMetrics
    noise_floor: ErrorMetrics
    reduction_percent: float
    ci95: tuple[float, float]


def measure_gain(
    record: Dataset, before: Signal, after: Signal, holdout: slice, floor: float, rng: np.random.Generator
) -> HoldoutGain:
    """Measure the reduction of the error on the hold-out part.

    Parameters
    ----------
    before, after : ndarray, shape (samples,)
        Outputs of the simulation without and with the effects, over the whole record.
    holdout : slice
        The hold-out part.
    floor : float
        RMSE of noise alone.
    """
    is_known = ~np.isnan(record.y[holdout])
    y = record.y[holdout][is_known]
    output_range = float(np.ptp(y)) or 1.0
    errors = [np.array(y - simulated[holdout][is_known]) for simulated in (before, after)]
    low, high = bound_reduction(errors[0], errors[1], rng)
    rmse = [float(np.sqrt(np.mean(each**2))) for each in errors]
    mape = [100 * float(np.mean(np.abs(each))) / output_range for each in errors]
    # The mean absolute value of normal noise is sqrt(2 / pi) of its standard deviation.
    noise_floor = ErrorMetrics(floor, 100 * floor * float(np.sqrt(2 / np.pi)) / output_range)
    return HoldoutGain(
        ErrorMetrics(rmse[0], mape[0]),
        ErrorMetrics(rmse[1], mape[1]),
        noise_floor,
        float(_compute_reduction(*(np.mean(each, keepdims=True) for each in _square(*errors)))[0]),
        (low, high),
    )


def compute_holdout_errors(fit: CalibrationResult, target: Target) -> Signal:
    """Return the errors of a fit at the samples of the hold-out part that are not missing."""
    errors: Signal = (target.y - fit_initial_states(fit, target, target.fitted).output)[target.fitted :]
    return errors[~np.isnan(target.y[target.fitted :])]


def bound_reduction(before: Signal, after: Signal, rng: np.random.Generator) -> tuple[float, float]:
    """Return the 95 % confidence interval of the reduction of an RMS error in percent.

    Parameters
    ----------
    before, after : ndarray, shape (samples,)
        Errors. Where both are zero, there is no reduction.
    """
    blocks = min(BLOCKS, before.size)
    squares = [sum_by_block(each, blocks) for each in _square(before, after)]
    drawn = rng.integers(0, blocks, (BOOTSTRAP_SAMPLES, blocks))
    reductions = _compute_reduction(*(each[drawn].sum(axis=1) for each in squares))
    low, high = np.quantile(reductions, [0.025, 0.975])
    return float(low), float(high)


def _square(before: Signal, after: Signal) -> list[Signal]:
    """Return the squares of errors divided by a power of two: squares of tiny errors are zero."""
    _, exponent = frexp(max(float(np.abs(each).max()) for each in (before, after)))
    return [np.ldexp(each, -exponent) ** 2 for each in (before, after)]


def _compute_reduction(before: Signal, after: Signal) -> Signal:
    """Return the reductions of RMS errors in percent from their scaled squares."""
    smallest = 1e-300  # of squares whose largest one is about 1: the ratio remains finite
    reductions: Signal = 100 * (1 - np.sqrt(np.maximum(after, smallest) / np.maximum(before, smallest)))
    return reductions


def bound_gain(
    gain: HoldoutGain,
    before: Signal,
    after: CalibrationResult,
    target: Target,
    rng: np.random.Generator,
) -> float:
    """Return an upper bound on the reduction of the error of the hold-out part, in percent.

    Slow noise hides in the RMSE that a simulation is worse: that of the innovations counts as well.

    Parameters
    ----------
    before : ndarray, shape (samples,)
        Output of the simulation without the effects.
    """
    if not after.noise.order:
        return gain.ci95[1]
    old, new = (
        after.noise.whiten(target.y - output, target.segments)[target.fitted :]
        for output in (before, after.output)
    )
    is_known = ~np.isnan(old)
    return min(gain.ci95[1], bound_reduction(old[is_known], new[is_known], rng)[1])


def compute_rmse(residual: Signal) -> float:
    """Return the RMS of a residual; missing samples, NaN, do not count."""
    return float(np.sqrt(np.mean(residual[~np.isnan(residual)] ** 2)))


def cross_validate_gain(
    before: CalibrationResult,
    keep_values: bool,
    after: CalibrationResult,
    target: Target,
    rng: np.random.Generator,
) -> float:
    """Return a lower bound on the gain of an extension over blocks that were left out of the fits.

    The unit is minus twice the log-likelihood. The first samples of every recording, as many as a block has
    but at most half of the recording, are always fitted, since the initial state is unknown otherwise.

    Parameters
    ----------
    keep_values : bool
        Whether ``before`` keeps its values instead of being calibrated to each fold.
    """
    fitted = target.fitted
    block = np.arange(target.y.size) * BLOCKS // fitted
    is_kept = block == 0
    for first, last in find_bounds(after.simulation.context.segments, fitted)[1:]:
        is_kept[first : first + min(-(-fitted // BLOCKS), (last - first) // 2)] = True
    numbers = np.unique(block[:fitted][~is_kept[:fitted]])
    fold = rng.permutation(np.arange(1, numbers.size + 1)) % FOLDS
    gains = []
    for each in range(FOLDS):
        left_out = numbers[fold == each]
        is_left_out = np.isin(block, left_out) & ~is_kept
        training = replace(target, noise=after.noise, estimation_part=target.estimation_part & ~is_left_out)
        old = before if keep_values else calibrate(before.simulation, training, before.values)
        new = calibrate(after.simulation, training, after.values)
        squares = [after.noise.whiten(target.y - fit.output, target.segments) ** 2 for fit in (old, new)]
        decrease, is_judged = squares[0] - squares[1], is_left_out & target.estimation_part
        gains += [float(np.sum(decrease[(block == number) & is_judged])) for number in left_out]
    weight = after.noise.effective_samples / np.count_nonzero(target.estimation_part)
    # Of exact data a fit leaves rounding errors, or nothing: the quotient would overflow.
    rounding = np.finfo(float).eps * float(np.max(np.abs(target.y[target.estimation_part])))
    return _bound_gain(weight * np.array(gains) / max(after.noise.variance, rounding**2), rng)


def _bound_gain(gains: Signal, rng: np.random.Generator) -> float:
    """Return a lower bound on the sum of the gains of all blocks."""
    gain, loss = float(gains[gains > 0.0].sum()), -float(gains[gains < 0.0].sum())
    if gain - loss > MIN_EVENT_GAIN and loss < MAX_LOSS_FRACTION * gain:
        return gain - loss
    drawn = rng.integers(0, gains.size, (BOOTSTRAP_SAMPLES, gains.size))
    return float(np.quantile(gains[drawn].sum(axis=1), LOWER_QUANTILE))


def sum_by_block(squares: Signal, blocks: int) -> Signal:
    """Return the sums over blocks of equal length, shape (blocks,)."""
    edges = np.linspace(0, squares.size, blocks + 1).astype(int)
    return np.add.reduceat(squares, edges[:-1])
