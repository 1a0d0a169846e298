"""The regressor matrix has the value of each expression per row; the Gram matrix its inner products."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from islands.errors import RecordError, SettingsError
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Lagged
from islands.expressions.user_primitive import primitive
from islands.kernels.summation import CHUNK, dot
from islands.models.regressor import regressor
from islands.program.regressor_matrix import gram_matrix, regressor_matrix
from islands.records.dataset import Dataset
from support.oracles import side_by_side
from support.strategies import INPUTS, nearly, records, regressors, settled_value


def of(text, table=PRIMITIVES):
    return regressor(parse(text, table))[1]


def ramp(segments):
    """Return a record with the sample index as output and a hundred times the index as input."""
    numbers = np.arange(sum(segments), dtype=float)
    return Dataset(100.0 * numbers, numbers, 0.1, segments=segments)


def noise(samples, segments=(), inputs=1):
    rng = np.random.default_rng(7)
    return Dataset(rng.normal(size=(samples, inputs)), rng.normal(size=samples), 0.1, segments=segments)


@given(records(longest=30), st.lists(regressors(), min_size=1, max_size=3))
def test_regressor_matrix_has_the_value_of_each_term_on_every_row(record, terms):
    warm_up = max(item.maximum_lag for item in terms)
    spans = [(begin + warm_up, end) for begin, end in record.bounds]
    samples = [sample for first, end in spans for sample in range(first, end)]
    assume(samples)
    channels = np.vstack([record.y, record.u.T])
    found = regressor_matrix(terms, record, warm_up)
    assert found.shape == (len(terms), len(samples))
    for item, column in zip(terms, found.tolist(), strict=True):
        for sample, number in zip(samples, column, strict=True):
            expected = settled_value(
                item.expression,
                lambda channel, lag, at=sample: float(channels[channel, at - lag]),
                perturbations=2,
            )
            assert expected is None or nearly(number, expected)


def test_row_reads_nothing_of_another_segment():
    record = noise(60, (20, 40))
    terms = [of("y(k-1)*u(k-3)"), of("exp(u(k-5))")]
    spoiled = Dataset(
        np.vstack([record.u[:20] + 7.0, record.u[20:]]),
        np.append(record.y[:20] - 7.0, record.y[20:]),
        0.1,
        segments=(20, 40),
    )
    before, after = (regressor_matrix(terms, each, 5) for each in (record, spoiled))
    np.testing.assert_array_equal(before[:, 15:], after[:, 15:])
    assert not np.any(before[:, :15] == after[:, :15])


def test_user_defined_primitive_equals_its_python_function():
    def backlash(a, b):
        return a - math.tanh(b) if a > b else a * b

    table = {**PRIMITIVES, "backlash": primitive("backlash", backlash)}
    record = noise(300, inputs=2)
    found = regressor_matrix([of("backlash(u1(k-1), y(k-2))*u2(k-1)", table)], record, 2)
    expected = [
        backlash(u, y) * v
        for u, y, v in zip(
            record.u[1:-1, 0].tolist(), record.y[:-2].tolist(), record.u[1:-1, 1].tolist(), strict=True
        )
    ]
    np.testing.assert_allclose(found[0], expected, rtol=1e-15)


SEGMENTS = ((1000,), (100, 300, 7, 593), (CHUNK + 3, CHUNK + 3, CHUNK + 3), (3 + CHUNK // 2,) * 4)


def products(terms, record, warm_up):
    """Return the inner products of the columns, in the order of 32 padded stretches per segment."""
    columns = regressor_matrix(terms, record, warm_up)
    rows = [end - begin - warm_up for begin, end in record.bounds if end - begin > warm_up]
    filled = side_by_side(columns, rows)
    return [[dot(one, 0, other, 0, one.size) for other in filled] for one in filled]


@pytest.mark.parametrize("segments", SEGMENTS)
def test_gram_matrix_equals_the_inner_products_bit_for_bit(segments):
    record = noise(sum(segments), segments, inputs=2)
    terms = [
        of("y(k-1)"),
        of("u1(k-3)*y(k-2)^2"),
        of("exp(u2(k-1))"),
        of("1"),
        of("sign(u1(k-1) - u1(k-2))"),
        Lagged(0),
    ]
    np.testing.assert_array_equal(gram_matrix(terms, record, 3), products(terms, record, 3))


@pytest.mark.parametrize("matrix", [regressor_matrix, gram_matrix])
def test_missing_output_is_refused_with_its_sample(matrix):
    y = np.arange(10.0)
    y[[6, 8]] = np.nan
    with pytest.raises(
        RecordError, match="x is missing at sample 6: estimation needs every sample, cut the record"
    ):
        matrix([of("u(k-1)")], Dataset(np.ones(10), y, 0.1, output_name="x"), 1)


@pytest.mark.parametrize("matrix", [regressor_matrix, gram_matrix])
def test_record_shorter_than_the_warm_up_is_refused_with_both_lengths(matrix):
    with pytest.raises(
        RecordError, match="the longest recording has 5 samples and 5 are needed before the first row"
    ):
        matrix([of("u(k-5)")], ramp((3, 5)), 5)


@pytest.mark.parametrize("matrix", [regressor_matrix, gram_matrix])
@pytest.mark.parametrize("warm_up", [-1, 0, 4])
def test_warm_up_shorter_than_the_largest_lag_is_refused(matrix, warm_up):
    with pytest.raises(SettingsError, match=f"the terms read 5 samples back, the warm-up has {warm_up}"):
        matrix([of("y(k-1)"), of("exp(u(k-5))")], ramp((20,)), warm_up)


@pytest.mark.parametrize("matrix", [regressor_matrix, gram_matrix])
def test_missing_input_is_refused(matrix):
    with pytest.raises(RecordError, match=f"the terms read input {INPUTS}, the record has 1"):
        matrix([of(f"y(k-1)*u{INPUTS}(k-1)")], ramp((20,)), 1)
