"""Long sums keep the order that stands in the source, and the order is a good one."""

import math

import numpy as np
import pytest

from islands.kernels.sums import FOLD, dot, dot_chunk, total

LENGTHS = [1, 2, 127, 128, 129, 255, 256, 257, 511, 512, 513, 1000, 5000]


def written_order(x, y):
    """The docstring of `sums` in plain floats: 256 products folded in halves, chunks from first to last."""
    products = [a * b for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    result = 0.0
    for begin in range(0, len(products), 256):
        chunk = products[begin : begin + 256]
        chunk += [0.0] * (256 - len(chunk))
        while len(chunk) > 1:
            half = len(chunk) // 2
            chunk = [a + b for a, b in zip(chunk[:half], chunk[half:], strict=True)]
        result += chunk[0]
    return result


def pair(seed, length):
    return np.random.default_rng(seed).normal(size=(2, length))


def inner(x, y, x_at=0, y_at=0, rows=None):
    return dot(x, x_at, y, y_at, x.size if rows is None else rows, np.empty(FOLD))


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("seed", [0, 1])
def test_an_inner_product_is_summed_in_the_written_order(seed, length):
    x, y = pair(seed, length)
    assert inner(x, y) == written_order(x, y)


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("seed", [0, 1])
def test_an_inner_product_is_exact_to_1e_15_of_the_sum_of_its_absolute_products(seed, length):
    x, y = pair(seed, length)
    products = [a * b for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    assert abs(inner(x, y) - math.fsum(products)) <= 1e-15 * math.fsum(map(abs, products))


def test_the_order_is_not_that_of_a_plain_loop():
    # 1e16 meets -1e16 in the first fold, before the ones are added: a loop from first to last loses them.
    x = np.zeros(FOLD)
    x[0], x[128], x[1:9] = 1e16, -1e16, 1.0
    assert inner(x, np.ones(FOLD)) == 8.0
    x[128], x[129] = 0.0, -1e16
    assert inner(x, np.ones(FOLD)) != 8.0


def test_a_sum_begins_at_its_offsets_and_reads_no_further_than_its_rows():
    x, y = np.full(700, np.nan), np.full(900, np.nan)
    x[100:400], y[555:855] = pair(2, 300)
    assert inner(x, y, 100, 555, 300) == written_order(x[100:400], y[555:855])


def test_no_rows_sum_to_zero():
    assert inner(np.full(3, np.nan), np.full(3, np.nan), rows=0) == 0.0


def test_the_room_for_the_fold_may_hold_anything():
    x, y = pair(3, 200)
    dirty = np.full(FOLD, np.nan)
    zero, rows = np.uint64(0), np.uint64(200)
    assert dot_chunk(x, zero, y, zero, rows, dirty) == written_order(x, y)


def test_adding_zeros_at_the_end_changes_nothing():
    x, y = pair(4, 300)
    longer = np.concatenate([x, np.zeros(1000)])
    assert inner(longer, np.concatenate([y, np.ones(1000)])) == inner(x, y)


@pytest.mark.parametrize("length", [1, 256, 777])
def test_a_total_is_the_inner_product_with_ones(length):
    x, _ = pair(5, length)
    assert total(x) == written_order(x, np.ones(length))


def test_the_total_of_nothing_is_zero():
    assert total(np.empty(0)) == 0.0


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_is_not_lost(value):
    x, y = pair(6, 400)
    x[300] = value
    assert not math.isfinite(inner(x, y))
