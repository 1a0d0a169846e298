"""Long sums have the documented order, which is accurate."""

import math

import numpy as np
import pytest

from islands.kernels.summation import CHUNK, dot

LENGTHS = [1, 2, 31, 32, 33, 127, 128, 129, 255, 256, 257, 511, 512, 513, 1000, 5000]


def folded(numbers):
    """Add the second half to the first half until one value is left."""
    while len(numbers) > 1:
        middle = len(numbers) // 2
        numbers = [a + b for a, b in zip(numbers[:middle], numbers[middle:], strict=True)]
    return numbers[0]


def written_order(x, y):
    """Return the sum in the order of the docstring of `summation`, in plain floats."""
    products = [a * b for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    products += [0.0] * (-len(products) % 256)
    running = [0.0] * 8
    for begin in range(0, len(products), 256):
        lanes = [0.0] * 8
        for row in range(256):
            lanes[row % 8] += products[begin + row]
        running = [a + b for a, b in zip(running, lanes, strict=True)]
    return folded(running)


def pair(seed, length):
    return np.random.default_rng(seed).normal(size=(2, length))


def inner(x, y, x_at=0, y_at=0, rows=None):
    return dot(x, x_at, y, y_at, x.size if rows is None else rows)


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("seed", [0, 1])
def test_inner_product_is_summed_in_the_documented_order(seed, length):
    x, y = pair(seed, length)
    assert inner(x, y) == written_order(x, y)


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("seed", [0, 1])
def test_inner_product_is_exact_to_1e_15_of_the_absolute_sum(seed, length):
    x, y = pair(seed, length)
    products = [a * b for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    assert abs(inner(x, y) - math.fsum(products)) <= 1e-15 * math.fsum(map(abs, products))


def test_products_are_rounded_before_they_are_added():
    # A fused multiply-add would keep the last bits of the square of 1 + 2^-30.
    x = np.zeros(CHUNK)
    x[0], x[32] = 1 + 2.0**-30, 1.0
    y = x.copy()
    y[32] = -(1 + 2.0**-29)
    assert inner(x, y) == 0.0
