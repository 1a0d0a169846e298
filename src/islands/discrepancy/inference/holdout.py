"""What an extension is worth: errors before and after on samples that nothing else has seen."""

from dataclasses import dataclass, replace

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, Target, calibrate
from islands.discrepancy.interfaces.effect import Signal

#: Blocks of a record, parts of them that are left out of a fit in turn, and draws of a bootstrap.
BLOCKS, FOLDS, DRAWS = 36, 3, 1000

#: Quantile of the held-out gain that has to be above zero.
LOW = 0.05

#: An event, such as a peak that is cut, comes in few blocks, and a bootstrap may draw none of them. It is
#: enough that blocks gain so much, in minus twice the log-likelihood, and lose no more than a part of it.
EVENT, LOST = 20.0, 0.1


@dataclass(frozen=True, slots=True)
class ErrorMetrics:
    """Errors of a simulation: RMSE in the output's unit, MAPE in percent of its range (equation 7)."""

    rmse: float
    mape: float


@dataclass(frozen=True, slots=True)
class HoldoutGain:
    """Errors over the locked part of a record.

    Attributes
    ----------
    before, after, noise_floor : ErrorMetrics
        Of the simulation calibrated without the effects, of the one with them, and of noise alone: an upper
        bound.
    reduction_percent : float
        By how much the RMSE is smaller.
    ci95 : tuple of float
        Of that, by a bootstrap of blocks.
    """

    before: ErrorMetrics
    after: ErrorMetrics
    noise_floor: ErrorMetrics
    reduction_percent: float
    ci95: tuple[float, float]


def measure_gain(
    record: Dataset, before: Signal, after: Signal, locked: slice, floor: float, rng: np.random.Generator
) -> HoldoutGain:
    """Measure a gain, once."""
    y = record.y[locked]
    spread = float(np.ptp(y)) or 1.0
    errors = [np.array(y - simulated[locked]) for simulated in (before, after)]
    squares = [_by_block(each**2, BLOCKS) for each in errors]
    drawn = rng.integers(0, BLOCKS, (DRAWS, BLOCKS))
    reductions = 100 * (1 - np.sqrt(squares[1][drawn].sum(axis=1) / squares[0][drawn].sum(axis=1)))
    low, high = np.quantile(reductions, [0.025, 0.975])
    rmse = [float(np.sqrt(np.mean(each**2))) for each in errors]
    mape = [100 * float(np.mean(np.abs(each))) / spread for each in errors]
    # Of normal noise the mean absolute value is sqrt(2 / pi) of the standard deviation.
    quiet = ErrorMetrics(floor, 100 * floor * float(np.sqrt(2 / np.pi)) / spread)
    return HoldoutGain(
        ErrorMetrics(rmse[0], mape[0]),
        ErrorMetrics(rmse[1], mape[1]),
        quiet,
        100 * (1 - rmse[1] / rmse[0]),
        (float(low), float(high)),
    )


def measure_holdout_gain(
    before: CalibrationResult,
    as_given: bool,
    after: CalibrationResult,
    target: Target,
    fitted: int,
    rng: np.random.Generator,
) -> float:
    """Return a low bound of what an extension gains on blocks that both were fitted without.

    In minus twice the log-likelihood. The first block is always fitted: the state at the record's beginning
    is not known otherwise.

    Parameters
    ----------
    as_given : bool
        What was before keeps its values.
    """
    block = np.arange(target.y.size) * BLOCKS // fitted
    fold = rng.permutation(np.arange(1, BLOCKS)) % FOLDS
    gains = []
    for each in range(FOLDS):
        out = np.arange(1, BLOCKS)[fold == each]
        cut = replace(
            target, noise=after.noise, estimation_part=target.estimation_part & ~np.isin(block, out)
        )
        old = before if as_given else calibrate(before.simulation, cut, before.values)
        new = calibrate(after.simulation, cut, after.values)
        missed = [after.noise.whiten(target.y - fit.output) ** 2 for fit in (old, new)]
        gains += [float(np.sum((missed[0] - missed[1])[block == number])) for number in out]
    worth = after.noise.effective_samples / np.count_nonzero(target.estimation_part)
    return _low(worth * np.array(gains) / after.noise.variance, rng)


def _low(gains: Signal, rng: np.random.Generator) -> float:
    won, lost = float(gains[gains > 0.0].sum()), -float(gains[gains < 0.0].sum())
    if won - lost > EVENT and lost < LOST * won:
        return won - lost
    drawn = rng.integers(0, gains.size, (DRAWS, gains.size))
    return float(np.quantile(gains[drawn].sum(axis=1), LOW))


def _by_block(squares: Signal, blocks: int) -> Signal:
    edges = np.linspace(0, squares.size, blocks + 1).astype(int)
    return np.add.reduceat(squares, edges[:-1])
