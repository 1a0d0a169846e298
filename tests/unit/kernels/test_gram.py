"""The Gram matrix is that of the columns, to the last bit, and the columns are never held."""

import math

import numpy as np
import pytest

from islands.kernels.columns import columns
from islands.kernels.gram import inner_products
from islands.kernels.sums import FOLD, dot
from islands.model.expression import Lagged
from islands.model.parsing import parse
from islands.model.regressor import regressor
from islands.program.linker import link

TEXTS = ["y(k-1)", "u(k-3)", "y(k-1)*u(k-1)^2*y(k-2)*u(k-2)", "sign(u(k-1) - u(k-2))", "1/(2 + abs(y(k-1)))"]
TERMS = [*(regressor(parse(text))[1] for text in TEXTS), Lagged(0, 0)]
WARM_UP = 3

#: Rows of the segments: a short record, whole chunks, chunks that span one boundary and several.
ROWS = [(1,), (40,), (FOLD,), (FOLD + 1,), (FOLD - 1, 1), (FOLD, FOLD), (100, 100, 100), (10, 1, 700, 3)]


def spans(rows):
    """First row and rows of every segment, and signals long enough."""
    begin = np.cumsum((0, *(count + WARM_UP for count in rows)))
    signals = np.random.default_rng(7).normal(size=(2, int(begin[-1])))
    return signals, begin[:-1] + WARM_UP, np.array(rows)


def gram(program, signals, first, rows, warm_up, out):
    """Fill a square of inner products, every pair computed on its own."""
    pairs = np.array([(i, j) for i in range(len(out)) for j in range(len(out))])
    flat = np.full(len(pairs), np.nan)
    inner_products(program, signals, first, rows, warm_up, pairs, flat)
    out[:] = flat.reshape(out.shape)


def gram_of(terms, rows):
    out = np.full((len(terms), len(terms)), np.nan)
    gram(link(terms), *spans(rows), WARM_UP, out)
    return out


def columns_of(terms, rows):
    out = np.empty((len(terms), sum(rows)))
    columns(link(terms), *spans(rows), WARM_UP, out)
    return out


@pytest.mark.parametrize("rows", ROWS)
def test_every_entry_is_the_inner_product_of_two_columns_bit_for_bit(rows):
    psi, found = columns_of(TERMS, rows), gram_of(TERMS, rows)
    count = psi.shape[1]
    for i in range(len(TERMS)):
        for j in range(i, len(TERMS)):
            assert found[i, j] == dot(psi[i], 0, psi[j], 0, count, np.empty(FOLD))


@pytest.mark.parametrize("rows", ROWS)
def test_entries_are_exact_to_1e_15_of_their_absolute_sum(rows):
    psi, found = columns_of(TERMS, rows), gram_of(TERMS, rows)
    for i, a in enumerate(psi.tolist()):
        for j, b in enumerate(psi.tolist()):
            products = [left * right for left, right in zip(a, b, strict=True)]
            assert abs(found[i, j] - math.fsum(products)) <= 1e-15 * math.fsum(map(abs, products))


def test_a_gram_matrix_is_symmetric_and_has_no_negative_direction():
    found = gram_of(TERMS, (10, 1, 700, 3))
    assert np.array_equal(found, found.T)
    assert np.linalg.eigvalsh(found).min() > 0


def test_an_entry_does_not_depend_on_the_terms_beside_it():
    together = gram_of(TERMS, (300, 500))
    for i in range(len(TERMS)):
        for j in range(len(TERMS)):
            assert gram_of([TERMS[i], TERMS[j]], (300, 500))[0, 1] == together[i, j]


def test_cutting_a_record_in_segments_that_warm_up_on_it_changes_no_bit():
    # The fold's order knows rows, not segments: the same rows in other stretches give the same sums.
    signals = np.random.default_rng(8).normal(size=(2, 603))
    whole, cut = np.empty((2, len(TERMS), len(TERMS)))
    gram(link(TERMS), signals, np.array([3]), np.array([600]), WARM_UP, whole)
    gram(link(TERMS), signals, np.array([3, 103, 404]), np.array([100, 301, 199]), WARM_UP, cut)
    assert np.array_equal(whole, cut)
