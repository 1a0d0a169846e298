"""Chance, as all forms draw it."""

import numpy as np


def sign(rng: np.random.Generator) -> float:
    """Draw a sign."""
    return float(rng.choice([-1.0, 1.0]))
