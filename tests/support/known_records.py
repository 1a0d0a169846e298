"""Records of simulated systems whose properties are known."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from islands.data.dataset import Dataset
from islands.kernels.memory_operators import play_from

Signal = NDArray[np.float64]


def white(samples: int, seed: int) -> Signal:
    return np.random.default_rng(seed).standard_normal(samples)


def steps(samples: int, seed: int, held: int = 25) -> Signal:
    levels = np.random.default_rng(seed).uniform(-1.0, 1.0, samples // held + 1)
    return np.repeat(levels, held)[:samples]


def slow(samples: int, seed: int) -> Signal:
    """Return white noise behind a second-order low-pass filter with a time constant of 20 samples."""
    return lag(lag(white(samples, seed), 20.0), 20.0)


def lag(u: Signal, constant: float) -> Signal:
    """Return a signal behind a first-order lag; it responds one sample later."""
    decay = np.exp(-1.0 / constant)
    return lfilter([0.0, 1.0 - decay], [1.0, -decay], u)


def delay(u: Signal, samples: int) -> Signal:
    return np.concatenate([np.full(samples, u[0]), u[: len(u) - samples]])


def hysteresis(u: Signal) -> Signal:
    """Return the sum of an input and of plays."""
    half = 0.5 * np.ptp(u)
    return 0.5 * u + sum(play_from(u, part * half) for part in (0.1, 0.3, 0.5))


def measure(u: Signal, y: Signal, noise: float = 0.0, seed: int = 0, dt: float = 1.0) -> Dataset:
    """Return a record with white noise, relative to the standard deviation of the output."""
    random = np.random.default_rng([seed, 1]).standard_normal(len(y))
    return Dataset(u, y + noise * y.std() * random, dt)
