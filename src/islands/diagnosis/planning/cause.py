"""Causes of given strength in a planned experiment."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from islands.diagnosis.inference.screening import get_starting_points
from islands.diagnosis.planning.experiment import ExperimentModel
from islands.diagnosis.planning.noise_free_fit import fit_noise_free
from islands.diagnosis.planning.response_dictionary import ResponseDictionary
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect

#: Factors of the starting point of an effect between which its strength is searched for.
_FACTORS = 2.0 ** np.arange(-24, 11)

#: Number of bisections of the interval that contains a strength.
_BISECTIONS = 9

#: Maximum number of corrections of the linear approximation, and the accuracy of the misfit that ends them.
_CORRECTIONS, _ACCURACY = 5, 0.93

#: Largest factor of a correction.
_MAX_CORRECTION = 5.0

#: Largest misfit of a cause relative to the wanted one.
_MAX_EXCESS = 3.0

#: Seed of the noise from which starting points of disturbances are taken.
_SEED = 20


@dataclass(frozen=True, slots=True, eq=False)
class Cause:
    """An effect with values, and the noise-free data that it causes.

    Attributes
    ----------
    effect : Effect
    values : tuple of float
        Values of its parameters.
    misfit : float
        Root mean square that calibration leaves of the response, in standard deviations of the noise;
        deviations from parameters with a tolerance count as far as the tolerance prevents them.
    whitened_misfit : float
        Root mean square of the same after whitening, which decides what is detected; equal to `misfit` in
        white noise.
    observed : ndarray, shape (channels * estimation samples,)
        Whitened data.
    """

    effect: Effect
    values: tuple[float, ...]
    misfit: float
    whitened_misfit: float
    observed: Signal


class CauseScale:
    """Values of one effect by the misfit that they cause.

    The shape of the effect is that of its middle starting point; its strength is scaled.

    Parameters
    ----------
    dictionary : ResponseDictionary
    effect : Effect
    """

    def __init__(self, dictionary: ResponseDictionary, effect: Effect) -> None:
        self._dictionary, self._effect = dictionary, effect
        self._model: ExperimentModel = dictionary.get_model(effect)
        experiment = dictionary.experiment
        context = experiment.context
        innovations = np.random.default_rng(_SEED).standard_normal(context.u.size)
        noise = experiment.noise.colour(innovations) * experiment.noise.std
        points = get_starting_points(effect, self._model.output, noise)
        self._point = np.array(points[len(points) // 2], dtype=np.float64)
        scaled = slice(0, max(effect.linear_parameters, 1))
        parameters = effect.parameters(context)
        self._nominal = self._point.copy()
        self._nominal[scaled] = [each.nominal for each in parameters[scaled]]
        direction = self._point - self._nominal
        limits = np.array(
            [each.upper if way > 0 else each.lower for each, way in zip(parameters, direction, strict=True)]
        )
        moves = direction != 0.0
        reach = (limits - self._nominal)[moves] / direction[moves]
        self._factors = np.unique(np.minimum(_FACTORS, float(np.min(reach, initial=_FACTORS[-1]))))
        self._misfits = self._compute_misfits(self._factors)

    def find_cause(self, misfit: float, is_whitened: bool = False) -> Cause | None:
        """Return the weakest cause of about a misfit; None if no value in the bounds reaches it.

        Calibration absorbs more of a strong effect than its linear approximation tells.

        Parameters
        ----------
        misfit : float
        is_whitened : bool
            Whether the misfit is that of whitened data.
        """
        wanted = misfit
        for _ in range(_CORRECTIONS):
            factor = self._find_factor(wanted, is_whitened)
            cause = None if factor is None else self.make_cause(self._get_values(factor))
            if cause is None:
                return None
            found = cause.whitened_misfit if is_whitened else cause.misfit
            if found > _ACCURACY * misfit:
                # A response that jumps, as that of an unstable integration, has no such misfit.
                return cause if found < _MAX_EXCESS * misfit else None
            wanted *= misfit / max(found, misfit / _MAX_CORRECTION)
        return None

    def _find_factor(self, misfit: float, is_whitened: bool) -> float | None:
        """Return the smallest factor of the starting point with a misfit in linear approximation."""
        reached = np.flatnonzero(self._misfits[int(is_whitened)] >= misfit)
        if not reached.size:
            return None
        high = float(self._factors[reached[0]])
        low = float(self._factors[max(reached[0] - 1, 0)])
        for _ in range(_BISECTIONS):
            middle = float(np.sqrt(low * high))
            if self._compute_misfits(np.array([middle]))[int(is_whitened), 0] < misfit:
                low = middle
            else:
                high = middle
        return high

    def make_cause(self, values: Sequence[float]) -> Cause | None:
        """Return the cause with given values; None if the simulation diverges."""
        observed = self._model.simulate(self._model.insert(self._effect, values)[None])[0]
        if not np.isfinite(observed).all():
            return None
        without = self._dictionary.without
        fit = fit_noise_free(without, observed, [without.output.nominal])
        misfit, whitened = self._measure(fit.residual)
        return Cause(self._effect, tuple(values), misfit, whitened, observed)

    def _get_values(self, factor: float) -> tuple[float, ...]:
        return tuple((self._nominal + factor * (self._point - self._nominal)).tolist())

    def _compute_misfits(self, factors: Signal) -> Signal:
        """Return linear approximations of the misfits at factors of the starting point.

        Returns
        -------
        ndarray, shape (2, factors)
            Misfits, and those of whitened data.
        """
        points = np.stack([self._model.insert(self._effect, self._get_values(each)) for each in factors])
        dictionary = self._dictionary
        misfits = [
            self._measure(dictionary.project(each - dictionary.output))
            for each in self._model.simulate(points)
        ]
        return np.nan_to_num(np.array(misfits).T, nan=np.inf)

    def _measure(self, remaining: Signal) -> tuple[float, float]:
        """Return the root mean squares of what calibration leaves of whitened data, before and after it."""
        experiment = self._dictionary.experiment
        before, after = (
            sqrt(float(each @ each) / experiment.estimation_samples)
            for each in (experiment.colour(remaining), remaining)
        )
        return before, after
