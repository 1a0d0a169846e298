"""Likeness: a cause that does the same as another on the average, and what tells the two apart.

An input that moves in slips follows a play of half the breakaway on the average. When each slip comes depends
on all before it, so that no simulation of it is in step with a record. But how its neighbours go together is
known: where the input moves slowly, samples of the same slip are out by nearly the same.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, Target
from islands.discrepancy.effects import catalogue_order
from islands.discrepancy.inference.screening import transfer_parameters
from islands.discrepancy.interfaces.effect import Effect, Signal

#: Parts of its strength that the other is simulated with: each comes at instants of its own.
INSTANTS = tuple(np.linspace(0.9, 1.1, 9).tolist())

#: Parts of what the other leaves beside that may still be there after calibration, one as likely as another.
STAYS = np.array([0.2, 0.4, 0.6, 0.8, 1.0])

#: Shifts of a residual, in parts of its length, that are too small to be another one.
NEAR = 0.05


@dataclass(frozen=True, slots=True)
class Confounder:
    """Another cause in the place of one.

    Attributes
    ----------
    effect : Effect
        The other cause.
    factor : float
        Its values are so many times the one's.
    gained : float
        What the residual says for it, in minus twice the log-likelihood; below zero against it.
    beside : float
        Mean square of what it does beside.
    """

    effect: Effect
    factor: float
    gained: float
    beside: float


def find_confounder(fit: CalibrationResult, effect: Effect, target: Target) -> Confounder | None:
    """Return what an effect of a fit is like on the average, if there is such."""
    simulation = fit.simulation
    if effect.confounded_with is None or effect.confounded_with[0] in simulation.effects:
        return None
    other, times = effect.confounded_with
    rest = (each for each in simulation.effects if each is not effect)
    there = simulation.with_effects(catalogue_order((*rest, other)))
    values = transfer_parameters(fit.values, simulation, there)
    beside, together = 0.0, np.zeros(np.count_nonzero(target.estimation_part) - 1)
    for part in INSTANTS:
        values[there.get_slice(other)] = part * times * fit.values[simulation.get_slice(effect)]
        left = (there.simulate(values) - fit.output)[target.estimation_part]
        beside += float(np.mean(left**2)) / len(INSTANTS)
        together += _neighbours(left) / len(INSTANTS)
    seen = _neighbours((target.y - fit.output)[target.estimation_part])
    return Confounder(other, times, _told(seen - seen.mean(), together - together.mean()), beside)


def _neighbours(signal: Signal) -> Signal:
    return np.array(signal[1:] * signal[:-1])


def _told(seen: Signal, expected: Signal) -> float:
    """Return by how much likelier it is to see what is expected than nothing of it.

    Its spread is that of the same signal shifted in time.
    """
    size = float(expected @ expected)
    if size == 0.0:
        return 0.0
    spectrum = np.conj(np.fft.rfft(expected)) * np.fft.rfft(seen)
    shifted = np.fft.irfft(spectrum, seen.size) / size
    near = int(NEAR * seen.size)
    spread = float(np.std(shifted[near:-near]))
    if spread == 0.0:
        return 0.0
    stays = (2 * STAYS * shifted[0] - STAYS**2) / spread**2
    return 2.0 * float(scipy.special.logsumexp(stays / 2) - np.log(STAYS.size))
