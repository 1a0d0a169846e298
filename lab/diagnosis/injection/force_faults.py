"""Force laws to inject into the equation of a plant.

Each factory takes a random generator and a strength and returns a `Force`: a function of the normalised
coordinate q, rate w and state z that returns the normalised force and the derivative of z by q.
"""

from math import copysign, sin, tanh

import numpy as np

from lab.diagnosis.injection.excitation import random_sign
from lab.diagnosis.injection.plant import Force


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


def cogging(rng: np.random.Generator, strength: float) -> Force:
    """Force with 4 to 20 periods over the typical range of the coordinate, at a random phase."""
    periods, phase = float(rng.uniform(4.0, 20.0)), float(rng.uniform(0.0, 2.0 * np.pi))
    return lambda q, _w, _z: (strength * sin(np.pi * periods * q + phase), 0.0)


def parallel(rng: np.random.Generator, strength: float) -> Force:
    """Second Bouc-Wen element of either sign."""
    c = random_sign(rng) * strength
    return lambda _q, w, z: (c * z, 1.0 - 2.4 * copysign(1.0, w) * z - 0.4 * abs(z))


def hysteresis(_rng: np.random.Generator, strength: float) -> Force:
    """Restoring Bouc-Wen element: its force always opposes the motion."""
    return lambda _q, w, z: (-strength * z, 1.0 - 2.4 * copysign(1.0, w) * z - 0.4 * abs(z))


def position_damping(_rng: np.random.Generator, strength: float) -> Force:
    """Damping that grows with the square of the coordinate (van der Pol)."""
    return lambda q, w, _z: (-strength * q * q * w, 0.0)


def tanh_spring(_rng: np.random.Generator, strength: float) -> Force:
    """Spring that saturates at a third of the typical coordinate."""
    return lambda q, _w, _z: (-strength * tanh(3.0 * q), 0.0)


def product(rng: np.random.Generator, strength: float) -> Force:
    """Product of coordinate and rate."""
    c = random_sign(rng) * strength
    return lambda q, w, _z: (c * q * w, 0.0)


def fifth_power(_rng: np.random.Generator, strength: float) -> Force:
    """Stiffness by the fifth power of the coordinate."""
    return lambda q, _w, _z: (-strength * q * q * q * q * q, 0.0)


def cubic_damping(_rng: np.random.Generator, strength: float) -> Force:
    """Damping by the third power of the rate."""
    return lambda _q, w, _z: (-strength * w**3, 0.0)


def position_friction(_rng: np.random.Generator, strength: float) -> Force:
    """Dry friction that grows with the distance from the origin."""
    return lambda q, w, _z: (-strength * abs(q) * tanh(30.0 * w), 0.0)
