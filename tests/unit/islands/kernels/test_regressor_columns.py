"""A column contains the value of its term on every row of every segment."""

import numpy as np
import pytest

from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.kernels.regressor_columns import columns
from islands.kernels.summation import CHUNK
from islands.models.regressor import regressor
from islands.program.regressor_matrix import arrange_rows
from islands.program.term_pool import link

TERMS = [
    "y(k-1)",
    "u2(k-9)",
    "y(k-1)*u1(k-4)",
    "u1(k-1)*u1(k-1)*y(k-2)",
    "y(k-1)*y(k-2)*u1(k-1)*u2(k-1)",
    "y(k-1)^2*u1(k-1)^2*u2(k-3)^3",
    "u1(k-2)*sign(u1(k-2) - u1(k-3))*(u1(k-2) - u1(k-3))",
    "max(u1(k-1), abs(y(k-5)))/(2 + y(k-1)*y(k-1))",
    "sqrt(y(k-1))*min(u1(k-1), u2(k-1))",
]

#: Segments of about 256 rows, the chunk of the kernel, with 9 samples before each first row.
LENGTHS = (10, 9 + CHUNK - 1, 9 + CHUNK, 9 + CHUNK + 1, 9 + 3 * CHUNK + 5)


def made(text):
    return regressor(parse(text))[1]


def evaluated(terms, signals, first, rows, warm_up):
    out = np.full((len(terms), sum(rows)), np.nan)
    columns(link(terms), arrange_rows(signals, list(zip(first, rows, strict=True)), warm_up), out)
    return out


def oracle(terms, signals, first, rows):
    samples = [begin + row for begin, count in zip(first, rows, strict=True) for row in range(count)]
    channels = signals.tolist()
    return np.array(
        [
            [value(term, lambda channel, lag, k=k: channels[channel][k - lag]) for k in samples]
            for term in terms
        ]
    )


@pytest.fixture(scope="module")
def signals():
    return np.random.default_rng(0).normal(size=(3, sum(LENGTHS)))


def test_every_row_of_every_segment_is_the_value_of_the_expression(signals):
    begin = np.cumsum((0, *LENGTHS[:-1]))
    first, rows = (begin + 9).tolist(), [length - 9 for length in LENGTHS]
    terms = [made(text) for text in TERMS]
    found = evaluated(terms, signals, first, rows, 9)
    assert np.array_equal(found, oracle([term.expression for term in terms], signals, first, rows))


@pytest.mark.parametrize("name", [name for name in PRIMITIVES if name not in ("phi1", "phi2")])
def test_every_primitive_equals_its_scalar_function(name):
    # Arguments that simplification keeps: of several sizes and signs, and exactly zero.
    axis = np.array([0.0, 1e-12, -1e-12, 0.3, -0.3, 1.0, -2.0, 7.5, -60.0, 1e3])
    signals = np.zeros((3, 100))
    signals[1], signals[2] = np.repeat(axis, 10), np.tile(axis, 10)
    arguments = "u1(k-1)" if PRIMITIVES[name].arity == 1 else "u1(k-1), u2(k-1)"
    term = made(f"{name}({arguments})")
    found = evaluated([term], signals, [1], [99], 1)
    np.testing.assert_allclose(found, oracle([term.expression], signals, [1], [99]), rtol=1e-15, atol=0)
