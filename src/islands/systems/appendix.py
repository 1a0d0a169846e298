"""The test systems S1 and S2 of equation (A.1) under soft and white inputs.

What the paper leaves open, and what stands here:

* (A.1) prints S1 with ``y``, not ``y~``, on the right-hand side, but calls both systems output-error systems.
  Here both recursions run on the noise-free output. Under the white and the rescaled soft input the median
  variance of S1 differs by less than one per cent between the two readings.
* The quoted SNRs are ``20 log10(var(y~) / var(e))``. So read, ``std(e) = 0.02`` and the *white* input give S1
  51.5 on average over 1000 seeds (quoted: 51.47), ``var(e) = 0.04 var(y~)`` gives S2 27.96 (quoted: 28.05).
* The soft input's scaling is not stated. Unscaled its variance is near 115 over 500 samples and S1 diverges.
  ``rescaled`` has variance 0.20 and gives S1 a median SNR of 57.3; ``unit-gain``, a filter that passes
  a constant unchanged, leaves a variance of 0.003 and an SNR of 15.4. The first is nearer: the default.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import RecordError, SettingsError

#: Samples of a training or a validation record.
SAMPLES = 500
#: Variance of the white noise that becomes the soft input.
SOFT_VARIANCE = 0.20
#: Poles of the low-pass that softens it.
POLES = (0.95, 0.9)

# What a seed is used for: the purposes of one seed share no draw.
_SOFT_INPUT, _SOFT_NOISE, _WHITE_INPUT, _WHITE_NOISE = range(4)

Signal = NDArray[np.float64]


def _rescaled(filtered: Signal) -> Signal:
    return filtered * float(np.sqrt(SOFT_VARIANCE) / filtered.std())


def _unit_gain(filtered: Signal) -> Signal:
    return filtered * float(np.prod(1.0 - np.array(POLES)))


#: How the filtered noise is scaled; the first one is the default.
SCALINGS: dict[str, Callable[[Signal], Signal]] = {"rescaled": _rescaled, "unit-gain": _unit_gain}


@dataclass(frozen=True, slots=True)
class OutputErrorSystem:
    """A system whose output is measured with white noise that never enters the recursion.

    Attributes
    ----------
    name : str
        ``s1`` or ``s2``.
    respond : callable
        Input of shape (samples,) to noise-free output of the same shape, from rest.
    noise : callable
        Noise-free output to the noise's standard deviation.
    """

    name: str
    respond: Callable[[Signal], Signal]
    noise: Callable[[Signal], float]


def respond_s1(u: Signal) -> Signal:
    """Noise-free output of S1 from rest, shape (samples,); equation (A.1).

    ``y~[k] = 0.75 y~[k-2] + 0.25 u[k-1] - 0.2 y~[k-2] u[k-1]``. It diverges where ``u`` stays below -1.25.
    """
    y = [0.0] * len(u)
    drive = u.tolist()
    for k in range(1, len(y)):
        past = y[k - 2] if k >= 2 else 0.0
        y[k] = 0.75 * past + 0.25 * drive[k - 1] - 0.2 * past * drive[k - 1]
    return np.array(y)


def respond_s2(u: Signal) -> Signal:
    """Noise-free output of S2 from rest, shape (samples,); equation (A.1).

    ``y~[k] = y~[k-1] y~[k-2] (2.5 + y~[k-1]) / (1 + y~[k-1]^2 + y~[k-2]^2) + u[k-11]``.
    """
    y = [0.0] * len(u)
    drive = u.tolist()
    for k in range(11, len(y)):
        one, two = y[k - 1], y[k - 2]
        y[k] = one * two * (2.5 + one) / (1.0 + one * one + two * two) + drive[k - 11]
    return np.array(y)


S1 = OutputErrorSystem("s1", respond_s1, lambda _: 0.02)
S2 = OutputErrorSystem("s2", respond_s2, lambda y: float(np.sqrt(0.04) * y.std()))


def soft_input(seed: int, scaling: str = "rescaled", samples: int = SAMPLES) -> Signal:
    """White Gaussian noise of variance 0.20 through a low-pass with poles 0.95 and 0.9, from rest.

    Parameters
    ----------
    seed : int
        Seeds the noise.
    scaling : str
        A name of `SCALINGS`: what becomes of the filtered noise's size.
    samples : int
        Length.

    Raises
    ------
    SettingsError
        The scaling is unknown.
    """
    if scaling not in SCALINGS:
        raise SettingsError(f"no scaling {scaling!r}: take one of {', '.join(SCALINGS)}")
    noise = np.sqrt(SOFT_VARIANCE) * _draw(seed, _SOFT_INPUT, samples)
    filtered: Signal = scipy.signal.lfilter([1.0], np.poly(POLES), noise)
    return SCALINGS[scaling](filtered)


def white_input(seed: int, samples: int = SAMPLES) -> Signal:
    """White Gaussian noise of variance one, shape (samples,): the ideal input of the validation data."""
    return _draw(seed, _WHITE_INPUT, samples)


def soft_record(
    system: OutputErrorSystem, seed: int = 0, scaling: str = "rescaled", samples: int = SAMPLES
) -> Dataset:
    """Make training data: the system under the soft input, its output with noise.

    Raises
    ------
    RecordError
        The system diverged under this input.
    SettingsError
        The scaling is unknown.
    """
    return _measure(system, soft_input(seed, scaling, samples), _draw(seed, _SOFT_NOISE, samples))


def white_record(system: OutputErrorSystem, seed: int = 0, samples: int = SAMPLES) -> Dataset:
    """Make validation data: the system under the white input, its output with noise.

    Raises
    ------
    RecordError
        The system diverged under this input.
    """
    return _measure(system, white_input(seed, samples), _draw(seed, _WHITE_NOISE, samples))


def _draw(seed: int, purpose: int, samples: int) -> Signal:
    sequence = np.random.SeedSequence(seed, spawn_key=(purpose,))
    return np.random.default_rng(sequence).standard_normal(samples)


def _measure(system: OutputErrorSystem, u: Signal, noise: Signal) -> Dataset:
    clean = system.respond(u)
    if not np.isfinite(clean).all():
        sample = int(np.argmin(np.isfinite(clean)))
        raise RecordError(f"{system.name} diverged at sample {sample} under this input: take another seed")
    return Dataset(u=u, y=clean + system.noise(clean) * noise, dt=1.0)
