"""Instant and form of a change that was detected in a sequence."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from islands.diagnosis.monitoring.change_detection import (
    WINDOW,
    estimate_autocorrelation,
    limit_values,
)
from islands.effects.interface.context import Signal

#: Probability of the interval of the first changed record.
PROBABILITY = 0.95

#: Difference in minus twice the log-likelihood by which a ramp must be better than a step.
MIN_RAMP_GAIN = 6.0


class ChangeForm(StrEnum):
    """Form of a change over the records."""

    STEP = "step"
    RAMP = "ramp"


@dataclass(frozen=True, slots=True)
class ChangePoint:
    """The first record after a change, with its interval.

    Attributes
    ----------
    record, earliest, latest : int
        Most likely first changed record, and the limits of its 95 % interval.
    form : ChangeForm
    """

    record: int
    earliest: int
    latest: int
    form: ChangeForm


def locate_change(values: Signal, errors: Signal, training: int) -> ChangePoint:
    """Estimate since which record a sequence has changed.

    The interval contains 95 % of the marginal likelihood of the instant; the mean before the change, its
    size and the variance are integrated out.

    Parameters
    ----------
    values, errors : ndarray, shape (records,)
        Values and their standard errors, as of `limit_values`.
    training : int
        Number of first records, which have not changed.
    """
    column, error = values[:, None], errors[:, None]
    rho = float(estimate_autocorrelation(limit_values(column, error, training), training)[0])
    # Without a limit, at which a ramp would become a step.
    sequence = limit_values(column, error, training, np.inf)[:, 0]
    count = sequence.size
    first = max(training, count - WINDOW)
    since = np.arange(first, count)
    places = np.arange(count)[:, None] - since
    # A ramp has a value at its first record already.
    shapes = {ChangeForm.STEP: places >= 0, ChangeForm.RAMP: np.maximum(places + 1.0, 0.0)}
    likelihoods = {
        form: _compute_likelihood(sequence, np.asarray(shape, dtype=np.float64), rho)
        for form, shape in shapes.items()
    }
    gain = 2.0 * float(np.max(likelihoods[ChangeForm.RAMP]) - np.max(likelihoods[ChangeForm.STEP]))
    form = ChangeForm.RAMP if gain > MIN_RAMP_GAIN else ChangeForm.STEP
    logarithm = likelihoods[form]
    cumulative = np.cumsum(np.exp(logarithm - np.max(logarithm)))
    cumulative /= cumulative[-1]
    tail = (1.0 - PROBABILITY) / 2
    lower, upper = np.searchsorted(cumulative, (tail, 1.0 - tail))
    best = int(np.argmax(logarithm))
    return ChangePoint(
        first + best, first + min(int(lower), best), first + max(min(int(upper), since.size - 1), best), form
    )


def _compute_likelihood(sequence: Signal, shapes: Signal, rho: float) -> Signal:
    """Return the marginal log-likelihood of a constant plus each shape, shape (shapes,)."""
    count = sequence.size
    root = np.sqrt(1.0 - rho**2)

    def whiten(signal: Signal) -> Signal:
        return np.concatenate([root * signal[:1], signal[1:] - rho * signal[:-1]])

    constant = whiten(np.ones(count))
    constant /= np.linalg.norm(constant)
    values = whiten(sequence)
    values = values - constant * (constant @ values)
    columns = whiten(shapes)
    columns = columns - np.outer(constant, constant @ columns)
    sizes = np.maximum(np.sum(columns**2, axis=0), np.finfo(float).tiny)
    remaining = float(values @ values) - (columns.T @ values) ** 2 / sizes
    scale = max(float(values @ values), np.finfo(float).tiny)
    remaining = np.maximum(remaining, 1e-12 * scale)
    likelihood: Signal = -0.5 * np.log(sizes) - 0.5 * (count - 2) * np.log(remaining)
    return likelihood
