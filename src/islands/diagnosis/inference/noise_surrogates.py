"""Surrogates of a residual: signals with the noise properties of a residual and without the effect in it."""

from collections.abc import Callable, Iterator, Sequence
from enum import Enum, auto

import numpy as np

from islands.effects.interface.context import Signal
from islands.records.noise_model import NoiseModel, fit_integrated_noise, fit_noise
from islands.records.segments import find_bounds

#: Loss of minus twice the log-likelihood, per sample, up to which a residual is taken for a random walk.
#: Calibration absorbs most of the slowest part of such noise, so that other models fit the rest better. Their
#: surrogates lack that part, and noise exceeds their thresholds too often.
MAX_UNIT_ROOT_LOSS = 1.0 / 150.0

#: Loss that the residual of a random walk reaches, in a record of any length: 4 to 28. A short record cannot
#: exclude a random walk.
LOSS_OF_RANDOM_WALKS = 30.0


class Randomisation(Enum):
    """Property of the innovations that is drawn; a surrogate keeps all others.

    With random signs, every innovation keeps its size, so that a changing variance and outliers stay where
    they are (wild bootstrap; Wu, 1986). With random phases, the innovations keep the part of their spectrum
    that the noise model does not whiten (Theiler et al., 1992).
    """

    SIGNS = auto()
    PHASES = auto()


def list_noise_models(residual: Signal, segments: Sequence[int]) -> list[NoiseModel]:
    """Return the noise models that a residual does not exclude, the most likely one first.

    Parameters
    ----------
    residual : ndarray, shape (samples,)
        Residual without gaps.
    segments : sequence of int
        Lengths of the recordings in samples.
    """
    noise = fit_noise(residual, segments=segments)
    integrated = fit_integrated_noise(residual, segments)
    loss = integrated.minus_twice_log_likelihood - noise.minus_twice_log_likelihood
    if loss < MAX_UNIT_ROOT_LOSS * residual.size:
        return [integrated]
    return [noise, integrated] if loss < LOSS_OF_RANDOM_WALKS else [noise]


def draw_surrogates(
    residual: Signal,
    noise: NoiseModel,
    segments: Sequence[int],
    randomisation: Randomisation,
    count: int,
    rng: np.random.Generator,
) -> Iterator[Signal]:
    """Draw surrogates of a residual.

    The innovations of its noise model are randomised and filtered with the model again. The first ones of
    every recording are kept, so that a surrogate begins with the level of the residual: that of a random walk
    has no distribution.

    Parameters
    ----------
    residual : ndarray, shape (samples,)
        Residual without gaps.
    noise : NoiseModel
        One of `list_noise_models`.
    segments : sequence of int
        Lengths of the recordings in samples.

    Yields
    ------
    ndarray, shape (samples,)
    """
    innovations = noise.whiten(residual, segments)
    stable = noise.limit_poles(residual.size)
    bounds = find_bounds(segments, residual.size)
    is_kept = np.zeros(residual.size, dtype=bool)
    for first, last in bounds:
        # Between many gaps, recordings may be as short as the model.
        is_kept[first : first + min(noise.order, (last - first) // 2)] = True
    centred = np.where(is_kept, 0.0, innovations - innovations[~is_kept].mean())
    randomise = _RANDOMISE[randomisation]
    for _ in range(count):
        drawn = np.where(is_kept, innovations, randomise(centred, rng))
        yield np.concatenate([stable.colour(drawn[first:last]) for first, last in bounds])


def _randomise_signs(innovations: Signal, rng: np.random.Generator) -> Signal:
    return innovations * rng.choice([-1.0, 1.0], innovations.size)


def _randomise_phases(innovations: Signal, rng: np.random.Generator) -> Signal:
    # Half of a period twice as long: the sum of a whole period would be that of the innovations.
    count = 2 * innovations.size
    spectrum = np.fft.rfft(np.concatenate([innovations, innovations[::-1]]))
    spectrum *= np.exp(2j * np.pi * rng.random(spectrum.size))
    return np.fft.irfft(spectrum, count)[: innovations.size]


_RANDOMISE: dict[Randomisation, Callable[[Signal, np.random.Generator], Signal]] = {
    Randomisation.SIGNS: _randomise_signs,
    Randomisation.PHASES: _randomise_phases,
}
