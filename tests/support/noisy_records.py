"""Records of a bilinear system with white, coloured and measurement noise, and the coverage of intervals."""

import numpy as np
from scipy.signal import lfilter

from islands.records.dataset import Dataset

#: Terms of the system, in canonical order, and their parameters.
TERMS = ("y(k-1)", "u(k-1)", "y(k-1)*u(k-1)")
TRUE = np.array([0.9, 0.3, -0.1])

#: Kinds of noise: white equation noise, white output noise, and ARMA(1, 1) equation noise.
NOISES = ("equation", "output", "arma")


def make_noisy_record(noise, seed, samples, standard_deviation=0.05):
    """Simulate ``y(k) = 0.9 y(k-1) + 0.3 u(k-1) - 0.1 u(k-1) y(k-1) + v(k)`` with a uniform input."""
    generator = np.random.default_rng(seed)
    u = generator.uniform(-1.0, 1.0, samples)
    e = standard_deviation * generator.standard_normal(samples)
    v = {"equation": e, "output": np.zeros(samples), "arma": lfilter([1.0, 0.5], [1.0, -0.7], e)}[noise]
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = (0.9 - 0.1 * u[k - 1]) * y[k - 1] + 0.3 * u[k - 1] + v[k]
    return Dataset(u, y + e if noise == "output" else y, 1.0)


def coverage(models):
    """Return the fraction of models, per parameter, whose 95 % interval contains the true parameter."""
    theta = np.array([model.theta for model in models])
    errors = np.array([model.standard_errors for model in models])
    return np.mean(np.abs(theta - TRUE) < 1.96 * errors, axis=0)
