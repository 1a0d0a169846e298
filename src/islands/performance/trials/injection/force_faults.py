"""Force laws to inject into the equation of a plant.

Each factory takes a random generator and a strength and returns a `Force`: a function of the normalised
coordinate q, rate w and state z that returns the normalised force and the derivative of z by q.
"""

from math import copysign, tanh

import numpy as np

from islands.performance.trials.injection.excitation import random_sign
from islands.performance.trials.injection.plant import Force


def viscous(_rng: np.random.Generator, strength: float) -> Force:
    """Viscous damping, proportional to the rate."""
    return lambda _q, w, _z: (-strength * w, 0.0)


def coulomb(_rng: np.random.Generator, strength: float) -> Force:
    """Coulomb friction."""
    return lambda _q, w, _z: (-copysign(strength, w) if w else 0.0, 0.0)


def stribeck(_rng: np.random.Generator, strength: float) -> Force:
    """Coulomb friction with a smooth change of sign within a thirtieth of the typical rate."""
    return lambda _q, w, _z: (-strength * tanh(30.0 * w), 0.0)


def one_sided(rng: np.random.Generator, strength: float) -> Force:
    """Direction-dependent viscous damping, proportional to the absolute rate."""
    c = random_sign(rng) * strength
    return lambda _q, w, _z: (-c * abs(w), 0.0)


def drag(_rng: np.random.Generator, strength: float) -> Force:
    """Quadratic drag."""
    return lambda _q, w, _z: (-strength * w * abs(w), 0.0)


def square(rng: np.random.Generator, strength: float) -> Force:
    """Quadratic (even) stiffness."""
    c = random_sign(rng) * strength
    return lambda q, _w, _z: (c * q * q, 0.0)


def cube(rng: np.random.Generator, strength: float) -> Force:
    """Cubic (odd) stiffness."""
    c = random_sign(rng) * strength
    return lambda q, _w, _z: (c * q * q * q, 0.0)


def parallel(rng: np.random.Generator, strength: float) -> Force:
    """Second Bouc-Wen element of either sign."""
    c = random_sign(rng) * strength
    return lambda _q, w, z: (c * z, 1.0 - 2.4 * copysign(1.0, w) * z - 0.4 * abs(z))


def hysteresis(_rng: np.random.Generator, strength: float) -> Force:
    """Restoring Bouc-Wen element: its force always opposes the motion."""
    return lambda _q, w, z: (-strength * z, 1.0 - 2.4 * copysign(1.0, w) * z - 0.4 * abs(z))
