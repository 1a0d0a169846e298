"""Inner products equal those of the columns to the last bit."""

import math

import numpy as np
import pytest

from islands.expressions.parsing import parse
from islands.expressions.tree import Lagged
from islands.kernels.gram import gram, gram_of_residual, inner_products
from islands.kernels.regressor_columns import columns
from islands.kernels.summation import CHUNK, dot
from islands.models.regressor import regressor
from islands.program.regressor_matrix import arrange_rows
from islands.program.term_pool import link
from support.oracles import side_by_side

#: The constant is also one on padding rows after the end of a segment, which must not count.
TEXTS = [
    "1",
    "y(k-1)",
    "u(k-3)",
    "y(k-1)*u(k-1)^2*y(k-2)*u(k-2)",
    "sign(u(k-1) - u(k-2))",
    "1/(2 + abs(y(k-1)))",
]
TERMS = [*(regressor(parse(text))[1] for text in TEXTS), Lagged(0, 0)]
WARM_UP = 3

#: Rows of the segments: a short record, whole chunks, and segments that end anywhere in a chunk.
ROWS = [
    (1,),
    (40,),
    (CHUNK,),
    (CHUNK + 1,),
    (CHUNK - 1, 1),
    (CHUNK, CHUNK),
    (100, 100, 100),
    (10, 1, 700, 3),
]


def record(rows, seed=7):
    """Return signals of segments with the given rows, each after a separate warm-up."""
    begin = np.cumsum((0, *(count + WARM_UP for count in rows)))
    signals = np.random.default_rng(seed).normal(size=(2, int(begin[-1])))
    return arrange_rows(signals, list(zip(begin[:-1] + WARM_UP, rows, strict=True)), WARM_UP)


def gram_of(terms, rows):
    out = np.full((len(terms), len(terms)), np.nan)
    gram(link(terms), rows, out)
    return out


def columns_of(terms, rows):
    out = np.empty((len(terms), rows.count))
    columns(link(terms), rows, out)
    return out


def products_of(terms, rows, pairs):
    out = np.full(len(pairs), np.nan)
    inner_products(link(terms), rows, np.ascontiguousarray(pairs), out)
    return out


@pytest.mark.ci  # compiles the kernel, which only others call
@pytest.mark.parametrize("terms", [TERMS[:count] for count in range(1, len(TERMS) + 1)])
@pytest.mark.parametrize("rows", ROWS)
def test_inner_products_of_some_pairs_equal_the_gram_matrix(rows, terms):
    square = np.array([(i, j) for i in range(len(terms)) for j in range(len(terms))])
    some = products_of(terms, record(rows), square[::-1])[::-1]
    assert np.array_equal(some.reshape(len(terms), len(terms)), gram_of(terms, record(rows)))


@pytest.mark.parametrize("rows", ROWS)
def test_every_entry_is_the_inner_product_of_padded_columns_bit_for_bit(rows):
    found, psi = gram_of(TERMS, record(rows)), side_by_side(columns_of(TERMS, record(rows)), rows)
    for i, one in enumerate(psi):
        for j, other in enumerate(psi):
            assert found[i, j] == dot(one, 0, other, 0, one.size)


@pytest.mark.parametrize("rows", ROWS)
def test_entries_are_exact_to_1e_15_of_their_absolute_sum(rows):
    psi, found = columns_of(TERMS, record(rows)), gram_of(TERMS, record(rows))
    for i, a in enumerate(psi.tolist()):
        for j, b in enumerate(psi.tolist()):
            products = [left * right for left, right in zip(a, b, strict=True)]
            assert abs(found[i, j] - math.fsum(products)) <= 1e-15 * math.fsum(map(abs, products))


@pytest.mark.parametrize("terms", [0, 3, 4, 7])
@pytest.mark.parametrize(("first", "last"), [(0, 2 * CHUNK), (5, CHUNK + 40), (17, 18)])
def test_gram_of_a_residual_equals_the_inner_products_of_its_rows(terms, first, last):
    rows = np.random.default_rng(terms).normal(size=(terms + 1, 2 * CHUNK))
    found = np.full((terms + 1, terms + 1), np.nan)
    gram_of_residual(rows[:-1], rows[-1], first, last, found)
    expected = [[dot(one, first, other, first, last - first) for other in rows] for one in rows]
    assert np.array_equal(found, expected)
