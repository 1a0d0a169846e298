"""Systems with a static curve, and a latent model with known parameters."""

import numpy as np

from islands.models.coupled_latent import CoupledLatentModel
from islands.models.latent import LatentModel, StateSpaceLayout
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset

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


def make_coupled_latent_model(**changes) -> CoupledLatentModel:
    """Return a resonance with a cubic spring, and a lag behind a saturation, of one input."""
    lag = {"a1_1": 0.8, "c1": 2.0, "e1_1": 0.4, "v1": 1.5, "s1": 0.1, "level": -1.0}
    second = {"output_name": "force (N)", "memory": 9, **changes}
    return CoupledLatentModel((make_model(**changes), make_model(lag, ("saturation",), 1, **second)))


def make_large_model() -> LatentModel:
    """Return a stable model of three inputs with long names, six units, and blocks that are zero in part."""
    layout, rng = StateSpaceLayout(6, 3, 6), np.random.default_rng(1)
    zero = {*(f"b{row}_3" for row in range(1, 7)), *(f"e{row}_4" for row in range(1, 7)), "f1", "f3"}
    zero |= {"d1", "d2", *(f"w2_{state}" for state in range(1, 7)), "v1_1", "v1_2", "v1_3", "v3_2"}
    names = [name for name in layout.names if name not in zero]
    return make_model(
        dict(zip(names, (0.1 * rng.standard_normal(len(names))).tolist(), strict=True)),
        ("tanh", "square", "hinge", "dead zone", "saturation", "bell"),
        6,
        input_names=("u0_V+1", "ambient temperature (degC)+1", "u2_V+1"),
        output_name="outlet temperature (degC)",
        operating_inputs=(0.1, 0.2, 0.3),
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


def curves_record(samples: int, seed: int, noise: float = 0.01) -> CoupledRecord:
    """Return a lag behind which the output is saturated, and two lags behind which it is squared."""
    u, x, y = 1.5 * smooth_input(samples, seed), np.zeros(3), np.empty((samples, 2))
    for k in range(samples):
        y[k] = np.tanh(2.0 * x[0]), x[1] + 0.3 * x[1] ** 2
        x = np.array([0.9 * x[0] + 0.2 * u[k], 0.8 * x[1] + 0.2 * x[2], 0.7 * x[2] + 0.3 * u[k]])
    y += noise * np.random.default_rng(seed + 50).standard_normal(y.shape)
    return CoupledRecord(
        tuple(Dataset(u, column, 0.01, ("u",), name) for column, name in zip(y.T, ("y1", "y2"), strict=True))
    )
