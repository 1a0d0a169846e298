"""Systems with a static curve, and a latent model with known parameters."""

import numpy as np

from islands.data.dataset import Dataset
from islands.models.latent import LatentModel

#: Parameters of a resonance with a cubic spring.
SPRING = {
    "a1_1": 0.9,
    "a1_2": 0.3,
    "a2_1": -0.3,
    "a2_2": 0.9,
    "b1": 0.02,
    "b2": 0.15,
    "c1": 1.2,
    "e2_1": -0.05,
    "w1_1": 1.0,
    "level": 0.3,
}


def make_model(parameters=SPRING, units=("cube",), order=2, **changes) -> LatentModel:
    """Return a model of one input with the given parameters."""
    fields = {"input_names": ("u_V",), "output_name": "y_mm", "dt": 0.01, "memory": 20}
    return LatentModel(
        order=order,
        units=units,
        wiring=tuple(parameters),
        parameters=tuple(parameters.values()),
        **{"operating_inputs": (0.0,), **fields, **changes},
    )


def smooth_input(samples: int, seed: int) -> np.ndarray:
    """Return noise of a low-pass of first order with the standard deviation 1."""
    white = np.random.default_rng(seed).standard_normal(samples)
    u = np.zeros(samples)
    for k in range(1, samples):
        u[k] = 0.7 * u[k - 1] + white[k]
    return u / u.std()


def spring_record(samples: int = 1500, noise: float = 0.0, seed: int = 0, start=(0.5, -0.4)) -> Dataset:
    """Return a record of the resonance with a cubic spring."""
    u, x = smooth_input(samples, seed), np.array(start)
    y = np.empty(samples)
    for k in range(samples):
        y[k] = 1.2 * x[0] + 0.3
        x = np.array(
            [
                0.9 * x[0] + 0.3 * x[1] + 0.02 * u[k],
                -0.3 * x[0] + 0.9 * x[1] + 0.15 * u[k] - 0.05 * x[0] ** 3,
            ]
        )
    y += noise * np.random.default_rng(seed + 1).standard_normal(samples)
    return Dataset(u, y, 0.01, ("u_V",), "y_mm")
