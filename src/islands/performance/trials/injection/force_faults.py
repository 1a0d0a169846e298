"""Forces, as they may be hidden in an equation: of coordinate and rate, each in its usual size.

Each takes chance and a strength, and gives a force in the usual size and how its own state changes with the
coordinate.
"""

from math import copysign, tanh

import numpy as np

from islands.performance.trials.injection.excitation import random_sign
from islands.performance.trials.injection.plant import Force


def viscous(_rng: np.random.Generator, strength: float) -> Force:
    """Act against the rate."""
    return lambda _q, w, _z: (-strength * w, 0.0)


def coulomb(_rng: np.random.Generator, strength: float) -> Force:
    """Rub dry."""
    return lambda _q, w, _z: (-copysign(strength, w) if w else 0.0, 0.0)


def stribeck(_rng: np.random.Generator, strength: float) -> Force:
    """Rub dry, turning within a thirtieth of the usual rate."""
    return lambda _q, w, _z: (-strength * tanh(30.0 * w), 0.0)


def one_sided(rng: np.random.Generator, strength: float) -> Force:
    """Rub more in one direction."""
    c = random_sign(rng) * strength
    return lambda _q, w, _z: (-c * abs(w), 0.0)


def drag(_rng: np.random.Generator, strength: float) -> Force:
    """Act against the rate's square."""
    return lambda _q, w, _z: (-strength * w * abs(w), 0.0)


def square(rng: np.random.Generator, strength: float) -> Force:
    """Act evenly."""
    c = random_sign(rng) * strength
    return lambda q, _w, _z: (c * q * q, 0.0)


def cube(rng: np.random.Generator, strength: float) -> Force:
    """Act oddly."""
    c = random_sign(rng) * strength
    return lambda q, _w, _z: (c * q * q * q, 0.0)


def parallel(rng: np.random.Generator, strength: float) -> Force:
    """Act as a Bouc-Wen element of its own."""
    c = random_sign(rng) * strength
    return lambda _q, w, z: (c * z, 1.0 - 2.4 * copysign(1.0, w) * z - 0.4 * abs(z))


def hysteresis(_rng: np.random.Generator, strength: float) -> Force:
    """Restore as a Bouc-Wen element: what it holds back is always against the motion."""
    return lambda _q, w, z: (-strength * z, 1.0 - 2.4 * copysign(1.0, w) * z - 0.4 * abs(z))
