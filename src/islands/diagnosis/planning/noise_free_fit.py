"""Least squares fit of a hypothesis to an experiment without noise.

Given a cause and normal noise of known covariance, the expected value of minus twice the log-likelihood ratio
between the cause and another hypothesis is the least sum of squares that the parameters of the hypothesis
leave of the whitened noise-free data (Kay, Fundamentals of Statistical Signal Processing: Detection Theory,
section 4.3).
"""

from collections.abc import Iterable
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
import scipy

from islands.diagnosis.calibration.problem import DIFFERENCE_STEP
from islands.diagnosis.planning.experiment import ExperimentModel
from islands.effects.interface.context import Signal

#: Maximum number of residuals that are evaluated in a fit, without those of its derivatives.
MAX_EVALUATIONS = 12

#: A fit ends at a step that decreases the sum of squares by less than this fraction.
MIN_RELATIVE_DECREASE = 1e-2


@dataclass(frozen=True, slots=True, eq=False)
class NoiseFreeFit:
    """Result of a fit without noise.

    Attributes
    ----------
    values : ndarray, shape (parameters,)
    residual : ndarray, shape (channels * estimation samples + parameters,)
        Differences of the whitened data, then the deviations from the nominal values in prior standard
        deviations. NaN if the simulation diverges.
    """

    values: Signal
    residual: Signal

    @property
    def squared_distance(self) -> float:
        """Sum of squares: the expected minus twice log-likelihood ratio; infinite for a diverged fit."""
        squares = float(self.residual @ self.residual)
        return squares if np.isfinite(squares) else np.inf


def fit_noise_free(
    model: ExperimentModel,
    observed: Signal,
    starts: Iterable[Signal],
    max_evaluations: int = MAX_EVALUATIONS,
) -> NoiseFreeFit:
    """Fit a model to noise-free data from several starting points, and return the best fit.

    Parameters
    ----------
    model : ExperimentModel
    observed : ndarray, shape (channels * estimation samples,)
        Whitened data.
    starts : iterable of ndarray, shape (parameters,)
        Starting points; those at which the simulation diverges are left out.
    max_evaluations : int
    """
    fits = [_fit(model, observed, start, max_evaluations) for start in starts]
    return min(fits, key=attrgetter("squared_distance"))


def _fit(model: ExperimentModel, observed: Signal, start: Signal, max_evaluations: int) -> NoiseFreeFit:
    lower, upper = model.output.bounds
    scales, nominal = model.output.scales, model.output.nominal
    start = np.clip(start, lower, upper)

    def find_residual(points: Signal) -> Signal:
        prior = model.inverse_prior_std * (points - nominal)
        return np.hstack([model.simulate(points) - observed, prior])

    first = find_residual(start[None])[0]
    if not (start.size and np.isfinite(first).all()):
        return NoiseFreeFit(start, first)

    def find_derivatives(steps: Signal) -> Signal:
        values = steps * scales
        moves = np.where(values + DIFFERENCE_STEP * scales <= upper, DIFFERENCE_STEP, -DIFFERENCE_STEP)
        points = np.vstack([values, values + np.diag(moves * scales)])
        residuals = find_residual(points)
        # A simulation that diverges at the shifted value gives no information about that direction.
        return np.nan_to_num((residuals[1:] - residuals[0]) / moves[:, None]).T

    best = scipy.optimize.least_squares(
        lambda steps: find_residual((steps * scales)[None])[0],
        start / scales,
        find_derivatives,
        bounds=(lower / scales, upper / scales),
        ftol=MIN_RELATIVE_DECREASE,
        max_nfev=max_evaluations,
    )
    return NoiseFreeFit(np.clip(best.x * scales, lower, upper), best.fun)
