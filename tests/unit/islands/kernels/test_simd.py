"""Every operation equals that of numpy in each lane, including NaN, infinities and both zeros."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.kernels import simd
from islands.kernels.simd import (
    VECTOR,
    address,
    fold,
    gather,
    load,
    read,
    store,
    write,
)

pytestmark = pytest.mark.ci

#: Numbers of vectors for which the operations are compiled.
COUNTS = (1, 13, *(pytest.param(count, marks=pytest.mark.nightly) for count in (3, 4)))


@cache
def compiled(function):
    from numba import njit

    return njit(function)


def njit(function):
    """Compile a function at its first call."""

    def run(*arguments):
        return compiled(function)(*arguments)

    return run


SPECIAL = [0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, 5e-324, -5e-324, 1e308, -1e308, 1 / 3]
every_number = st.sampled_from(SPECIAL) | st.floats()


def rows(count, several=2):
    """Return a strategy for rows of as many values as lanes, including special values."""
    row = st.lists(every_number, min_size=VECTOR * count, max_size=VECTOR * count).map(np.array)
    return st.tuples(*[row] * several)


def same(found, expected):
    """Return whether two arrays agree in every bit, except for the payload of a NaN."""
    nan = np.isnan(expected)
    return np.array_equal(np.isnan(found), nan) and found[~nan].tobytes() == expected[~nan].tobytes()


@cache
def pairwise(name, count):
    operation = getattr(simd, name)

    @njit
    def run(x, y, out):
        zero = 0
        store(out, zero, operation(load(x, zero, count), load(y, zero, count)))

    return run


@njit
def gathered(x, a, b, c, d, out):
    store(out, 0, gather(x, a, b, c, d))


@njit
def folded(x):
    return fold(load(x, 0, 1))


@njit
def moved(x, x_at, out, out_at):
    store(out, np.uint64(out_at), load(x, np.uint64(x_at), 3))


@njit
def moved_by_address(x, x_at, out, out_at):
    write(address(out, out_at), read(address(x, x_at), 3))
    # The arrays are used once more, so that they live until here.
    return x.size + out.size


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("name", ["add", "subtract", "multiply"])
@given(st.data())
def test_arithmetic_applies_to_every_lane(name, count, data):
    x, y = data.draw(rows(count))
    out = np.empty_like(x)
    pairwise(name, count)(x, y, out)
    with np.errstate(all="ignore"):
        assert same(out, getattr(np, name)(x, y))


def test_gathered_vectors_start_at_the_offsets():
    x, out = np.arange(100.0), np.empty(32)
    gathered(x, 3, 50, 0, 17, out)
    assert out.tolist() == [*range(3, 11), *range(50, 58), *range(8), *range(17, 25)]


@given(rows(1, 1))
def test_fold_adds_halves_until_one_value_is_left(drawn):
    (x,) = drawn
    with np.errstate(all="ignore"):
        a, b, c, d = x[:4] + x[4:]
        expected = (a + c) + (b + d)
    assert same(np.array([folded(x)]), np.array([expected]))


@pytest.mark.parametrize("move", [moved, moved_by_address], ids=["offset", "address"])
@given(st.integers(0, 20), st.integers(0, 20))
def test_loads_and_stores_at_any_offset_touch_nothing_else(move, x_at, out_at):
    x, out = np.arange(50.0), np.full(50, -1.0)
    move(x, x_at, out, out_at)
    expected = np.full(50, -1.0)
    expected[out_at : out_at + 24] = x[x_at : x_at + 24]
    assert np.array_equal(out, expected)
