"""Confounders: effects with the same mean response as another one, and the evidence that separates both.

The mean response of stick-slip motion is a play whose half width is half the breakaway. The instant of each
slip depends on all earlier ones, so that no simulation predicts it. The serial correlation of the slips is
known, though: while the input moves slowly, all samples of one slip have nearly the same error.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.screening import transfer_parameters
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect
from islands.records.segments import map_segments

#: Factors on the strength of the confounder in its simulations; each moves the slips to other instants.
STRENGTH_FACTORS = tuple(np.linspace(0.9, 1.1, 9).tolist())

#: Fractions of the expected serial correlation that may remain after calibration, with equal prior
#: probability.
REMAINING_FRACTIONS = np.array([0.2, 0.4, 0.6, 0.8, 1.0])

#: Circular shifts below this fraction of the length are too small to give an independent signal.
MIN_SHIFT_FRACTION = 0.05


@dataclass(frozen=True, slots=True)
class Confounder:
    """An effect with the same mean response as an effect of a fit.

    Attributes
    ----------
    effect : Effect
        The confounder.
    factor : float
        Factor from the values of the effect to those of the confounder.
    score_gain : float
        Twice the log-likelihood ratio in favour of the confounder; negative if the residual is evidence
        against it.
    excess_mean_square : float
        Mean square of the part of its response that the effect does not have.
    """

    effect: Effect
    factor: float
    score_gain: float
    excess_mean_square: float


def find_confounder(fit: CalibrationResult, effect: Effect, target: Target) -> Confounder | None:
    """Return the confounder of an effect of a fit; None if it has none or the fit includes both.

    It is also None if the simulation diverges with the confounder, as that of an identified model may.
    """
    simulation = fit.simulation
    if effect.confounded_with is None or effect.confounded_with[0] in simulation.effects:
        return None
    other, factor = effect.confounded_with
    remaining = (each for each in simulation.effects if each is not effect)
    replaced = simulation.with_effects((*remaining, other))
    values = transfer_parameters(fit.values, simulation, replaced)
    segments = target.fitted_segments
    excess_mean_square, expected = 0.0, np.zeros(sum(segments) - len(segments))
    for strength in STRENGTH_FACTORS:
        values[replaced.get_slice(other)] = strength * factor * fit.values[simulation.get_slice(effect)]
        excess = (replaced.simulate(values) - fit.output)[target.estimation_part]
        excess_mean_square += float(np.mean(excess**2)) / len(STRENGTH_FACTORS)
        expected += map_segments(_multiply_neighbours, excess, segments) / len(STRENGTH_FACTORS)
    if not np.isfinite(excess_mean_square):
        return None
    residual = (target.y - fit.output)[target.estimation_part]
    measured = map_segments(_multiply_neighbours, residual, segments)
    ratio = _log_likelihood_ratio(measured - measured.mean(), expected - expected.mean())
    return Confounder(other, factor, ratio, excess_mean_square)


def _multiply_neighbours(signal: Signal) -> Signal:
    return np.array(signal[1:] * signal[:-1])


def _log_likelihood_ratio(measured: Signal, expected: Signal) -> float:
    """Return twice the log-likelihood ratio of the expected signal being present against absent.

    The standard deviation of the estimated amplitude is that over circular shifts of the measured signal.
    Products with the samples of another recording are in the shifted signals only, and are few.
    """
    size = float(expected @ expected)
    if size == 0.0:
        return 0.0
    spectrum = np.conj(np.fft.rfft(expected)) * np.fft.rfft(measured)
    amplitudes = np.fft.irfft(spectrum, measured.size) / size
    min_shift = int(MIN_SHIFT_FRACTION * measured.size)
    std = float(np.std(amplitudes[min_shift:-min_shift]))
    if std == 0.0:
        return 0.0
    ratios = (2 * REMAINING_FRACTIONS * amplitudes[0] - REMAINING_FRACTIONS**2) / std**2
    return 2.0 * float(scipy.special.logsumexp(ratios / 2) - np.log(REMAINING_FRACTIONS.size))
