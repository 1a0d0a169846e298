"""Gain of an effect by chance, from surrogates of the record's own noise.

The gain in minus twice the log-likelihood has a chi-squared distribution only if the noise model is right. A
changing variance, heavy tails and colour that the noise model does not whiten make larger gains common.
"""

from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.calibration.problem import DIFFERENCE_STEP
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.noise_surrogates import (
    Randomisation,
    draw_surrogates,
    list_noise_models,
)
from islands.diagnosis.inference.screening import DEPENDENCE, extend, simulate_starting_points
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect

#: Number of surrogates of each kind.
SURROGATES = 300

#: Probability that the best of all effects exceeds its threshold by chance.
FALSE_ALARM_PROBABILITY = 0.01

#: Fraction of the largest gains from which the tail of their distribution is extrapolated.
TAIL_FRACTION = 0.1

#: Seed of the surrogates. It is fixed, so that the same fit has the same threshold in every search.
SEED = 20


def compute_chance_gain(
    fit: CalibrationResult,
    without: CalibrationResult,
    effect: Effect,
    target: Target,
    effect_count: int,
    surrogates: Sequence[Signal],
) -> float:
    """Return the gain of one effect that noise exceeds with a probability of `FALSE_ALARM_PROBABILITY`.

    This is the probability for all effects together (Bonferroni). Responses to the effect are linear, at its
    fitted values and at its starting points; calibration absorbs its part of them.

    Parameters
    ----------
    fit, without : CalibrationResult
        The simulation with the effect and without it.
    effect_count : int
        Number of effects that are searched for.
    surrogates : sequence of ndarray
        Surrogates of the noise, see `draw_noise`: of the fit with the effect, since a noise model that is
        fitted without a true effect contains it as colour; without a noise model of the fit without the
        effect, since the whole residual competes with it.

    Returns
    -------
    float
        Gain in minus twice the log-likelihood, without a penalty on the values of the effect.
    """
    projection = Projection(without, target)
    start = fit.simulation.nominal
    changes = []
    for index in range(*fit.simulation.get_slice(effect).indices(start.size)):
        shifted = fit.values.copy()
        shifted[index] += DIFFERENCE_STEP * fit.simulation.scales[index]
        changes.append(fit.simulation.simulate(shifted) - fit.output)
    responses = [changes, *([each] for each in _simulate_starting_points(without, effect, target))]
    bases = [basis for each in responses if (basis := _orthonormalise(each, projection)).size]

    def compute_gains(residuals: Signal) -> Signal:
        remaining = [residuals - basis @ (basis.T @ residuals) for basis in bases]
        gains: Signal = np.max(
            [_compute_gain(residuals, each, target, without) for each in remaining], axis=0
        )
        return gains

    probability = FALSE_ALARM_PROBABILITY / effect_count
    return _find_threshold(surrogates, projection, compute_gains, probability) if bases else 0.0


class ForwardSelection:
    """Forward selection among the linear responses to all effects, and the gain that it reaches by chance.

    Orthogonal matching pursuit (Pati et al., 1993) selects among the responses at all starting points.

    Parameters
    ----------
    base : CalibrationResult
        The simulation without effects. Surrogates of its residual have no cause.
    target : Target
    effects : sequence of Effect
    steps : int
        Number of responses to select.
    """

    def __init__(
        self, base: CalibrationResult, target: Target, effects: Sequence[Effect], steps: int
    ) -> None:
        self._base, self._target, self._steps = base, target, steps
        self._projection = Projection(base, target)
        responses = [
            response for effect in effects for response in _simulate_starting_points(base, effect, target)
        ]
        bases = [_orthonormalise([each], self._projection) for each in responses]
        unit = [basis for basis in bases if basis.size]
        self._dictionary = np.column_stack(unit) if unit else np.empty((self._projection.residual.size, 0))
        self._gram = self._dictionary.T @ self._dictionary

    def compute_gain(self) -> float:
        """Return the gain of the selected responses."""
        return float(self._compute_gains(self._projection.residual[:, None])[0])

    def compute_chance_gain(self, probability: float = FALSE_ALARM_PROBABILITY) -> float:
        """Return the gain that is exceeded with a probability if the residual is noise."""
        surrogates = draw_noise(self._base, self._target)
        return _find_threshold(surrogates, self._projection, self._compute_gains, probability)

    def _compute_gains(self, residuals: Signal) -> Signal:
        products = self._dictionary.T @ residuals
        weights = np.column_stack([_pursue(self._gram, each, self._steps) for each in products.T])
        remaining = residuals - self._dictionary @ weights
        return _compute_gain(residuals, remaining, self._target, self._base)


def draw_noise(fit: CalibrationResult, target: Target) -> list[Signal]:
    """Draw surrogates of the residual of a fit, whitened: arrays of shape (surrogates, selected samples).

    They are of every noise model that the residual does not exclude. Without a noise model they are of the
    most likely one: thresholds of random walks would hide all causes of a slow model error.
    """
    part, rng = target.estimation_part, np.random.default_rng(SEED)
    residual, segments = (target.y - fit.output)[part], target.fitted_segments
    models = list_noise_models(residual, segments)
    kinds = []
    for model in models if target.effective_samples is None else models[:1]:
        for randomisation in Randomisation:
            drawn = draw_surrogates(residual, model, segments, randomisation, SURROGATES, rng)
            kinds.append(np.stack([target.select(_insert(each, part)) for each in drawn]))
    return kinds


def _find_threshold(
    surrogates: Sequence[Signal],
    projection: Projection,
    compute_gains: Callable[[Signal], Signal],
    probability: float,
) -> float:
    """Return the gain that is exceeded with a probability in surrogates of the noise."""
    return max(
        _extrapolate_quantile(compute_gains(projection.project_whitened(drawn)), probability)
        for drawn in surrogates
    )


def _insert(signal: Signal, part: NDArray[np.bool_]) -> Signal:
    """Return a signal over the whole record, given its values in the estimation part."""
    whole = np.zeros(part.size)
    whole[part] = signal
    return whole


def _simulate_starting_points(base: CalibrationResult, effect: Effect, target: Target) -> Signal:
    """Return the responses to an effect at its starting points, shape (points, samples)."""
    return simulate_starting_points(base, extend(base, effect), effect, target)[1]


def _orthonormalise(responses: Sequence[Signal], projection: Projection) -> Signal:
    """Return an orthonormal basis of the part of responses that calibration does not absorb."""
    projected = [projection(response) for response in responses if np.isfinite(response).all()]
    unit = [response / size for response in projected if (size := float(np.linalg.norm(response)))]
    return scipy.linalg.orth(np.column_stack(unit), rcond=DEPENDENCE) if unit else np.empty((0, 0))


def _pursue(gram: Signal, products: Signal, steps: int) -> Signal:
    """Return the weights of orthogonal matching pursuit, given inner products of unit vectors."""
    weights = np.zeros(products.size)
    selected: list[int] = []
    correlations = products
    for _ in range(min(steps, products.size)):
        selected.append(int(np.argmax(np.abs(correlations))))
        found = np.linalg.lstsq(gram[np.ix_(selected, selected)], products[selected], rcond=DEPENDENCE)[0]
        correlations = products - gram[:, selected] @ found
        weights[:] = 0.0
        weights[selected] = found
    return weights


def _compute_gain(residuals: Signal, remaining: Signal, target: Target, without: CalibrationResult) -> Signal:
    """Return the gain in each of several residuals, given what remains of them, shape (surrogates,)."""
    # The rows after those of the samples are deviations of the parameters from their priors.
    samples = int(np.count_nonzero(target.estimation_part))
    before, after = (np.sum(each[:samples] ** 2, axis=0) for each in (residuals, remaining))
    prior_before, prior_after = (
        np.sum(each[samples:] ** 2, axis=0) / target.prior_weight for each in (residuals, remaining)
    )
    gains: Signal = without.noise.effective_samples * np.log(before / after) + prior_before - prior_after
    return gains


def _extrapolate_quantile(gains: Signal, probability: float) -> float:
    """Return the value that is exceeded with a small probability, from an exponential tail."""
    start = float(np.quantile(gains, 1.0 - TAIL_FRACTION))
    mean_excess = float(np.mean(gains[gains >= start] - start))
    return start + mean_excess * float(np.log(TAIL_FRACTION / probability))
