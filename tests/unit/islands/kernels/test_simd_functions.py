"""Functions of vectors: the exponential and the hyperbolic tangent are those of numpy but for rounding."""

import numpy as np
import pytest

from islands.kernels.simd import load, store
from islands.kernels.simd_functions import clip, exponential, hyperbolic_tangent

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def apply():
    """Apply the exponential, the hyperbolic tangent and a limit of 1 to numbers."""
    from numba import njit

    @njit
    def run(x, found):
        for k in range(0, x.size, 8):
            vector = load(x, k, 1)
            store(found, k, exponential(vector))
            store(found, x.size + k, hyperbolic_tangent(vector))
            store(found, 2 * x.size + k, clip(vector, 1.0))

    def apply(numbers):
        x = np.zeros(-(-len(numbers) // 8) * 8)
        x[: len(numbers)] = numbers
        found = np.empty((3, x.size))
        run(x, found)
        return found[:, : len(numbers)]

    return apply


def test_finite_numbers(apply):
    x = np.concatenate([np.linspace(-700.0, 700.0, 20_001), np.linspace(-3.0, 3.0, 20_001), [0.0, 1e-300]])
    exponentials, tangents, limited = apply(x)
    assert np.abs(exponentials / np.exp(x) - 1.0).max() < 5e-16
    assert np.abs(tangents - np.tanh(x)).max() < 5e-16
    assert np.array_equal(limited, np.clip(x, -1.0, 1.0))
