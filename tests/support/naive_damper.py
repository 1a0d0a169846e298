"""Simple model of a damper: viscous friction, a spring and a preload."""

import numpy as np


def force(u, dt, c=1.0, k=1.0, f0=100.0):
    """Return the force in N at a displacement ``u`` in mm."""
    return c * np.gradient(u, dt) + k * u + f0
