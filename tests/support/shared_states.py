"""Two resonances that two outputs share, and a feedback whose gain follows the amplitude of the inputs."""

import numpy as np

from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset

POLES = np.array([0.8 * np.exp(0.7j), 0.8 * np.exp(-0.7j), 0.85 * np.exp(1.9j), 0.85 * np.exp(-1.9j)])
A = np.zeros((4, 4))
for _at, _pole in ((0, POLES[0]), (2, POLES[2])):
    A[_at : _at + 2, _at : _at + 2] = [[_pole.real, _pole.imag], [-_pole.imag, _pole.real]]
B = np.array([[1.0, 0.2], [0.3, -0.7], [0.4, 0.9], [-0.6, 0.5]])
C = np.array([[1.0, 0.3, -0.5, 0.2], [0.2, 0.8, 0.4, -0.9]])


def make_record(seed, levels, softening, samples=2000):
    """Return recordings of a system whose poles turn more slowly the larger the level of the inputs is."""
    rng = np.random.default_rng(seed)
    u = np.concatenate([level * rng.standard_normal((samples, 2)) for level in levels])
    y, x = np.empty((len(u), 2)), np.zeros(4)
    for row, inputs in enumerate(u):
        y[row] = C @ x
        x = (A - softening * levels[row // samples] * B @ C) @ x + B @ inputs
    y += 0.02 * y.std(axis=0) * rng.standard_normal(y.shape)
    segments = (samples,) * len(levels)
    return CoupledRecord(
        tuple(
            Dataset(u, column, 0.01, ("p_V", "q_V"), name, segments=segments)
            for column, name in zip(y.T, ("a_m", "b_m"), strict=True)
        )
    )
