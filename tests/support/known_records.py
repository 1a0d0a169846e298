"""Records of simulated systems whose properties are known."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from islands.kernels.memory_operators import play_from
from islands.records.dataset import Dataset

Signal = NDArray[np.float64]

#: Law of `runaway`.
RUNAWAY = {"y(k-1)": 0.9, "u(k-1)": 0.1, "y(k-1)^2": 0.02, "y(k-1)*u(k-1)": 0.08}


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


def runaway(samples: int, seed: int, noise: float) -> Dataset:
    """Return a record of a reaction that runs away if the input is held at 0.8 of its amplitude.

    Shorter steps of the full amplitude leave the output bounded. The noise is a fraction of its range.
    """
    generator = np.random.default_rng(seed)
    levels = np.repeat(generator.uniform(-1.0, 1.0, samples), generator.integers(3, 10, samples))
    u, y = levels[:samples], np.zeros(samples)
    for k in range(1, samples):
        terms = y[k - 1], u[k - 1], y[k - 1] ** 2, y[k - 1] * u[k - 1]
        y[k] = np.dot([*RUNAWAY.values()], terms)
    y += noise * np.ptp(y) * generator.standard_normal(samples)
    return Dataset(u[:, None], y, 1.0)
