"""The factorisation is orthogonal to the last digits, even for nearly dependent columns."""

import numpy as np
import pytest

from islands.kernels.qr import orthogonalise

SHAPES = [(1, 1), (1, 10), (3, 3), (4, 255), (5, 256), (6, 257), (12, 1000)]


def factored(matrix, target=None, tolerance=1e-11):
    """Return Q, R, Q'y, the residual and the first dependent column; each row of an array is a column."""
    q = np.array(matrix, dtype=np.float64, order="C")
    columns, rows = q.shape
    residual = np.zeros(rows) if target is None else np.array(target)
    triangle, projection = np.full((columns, columns), np.nan), np.full(columns, np.nan)
    dependent = orthogonalise(q, residual, triangle, projection, tolerance)
    return q, triangle, projection, residual, dependent


def random(columns, rows, seed=0):
    generator = np.random.default_rng(seed)
    return generator.normal(size=(columns, rows)), generator.normal(size=rows)


def nearly_parallel(condition, columns=6, rows=800, seed=1):
    """Return columns that are parallel to the first, except for a fraction of 1 / condition."""
    matrix, target = random(columns, rows, seed)
    matrix[1:] = matrix[0] + matrix[1:] / condition
    return matrix, target


@pytest.mark.parametrize("shape", SHAPES)
def test_product_of_the_factors_is_the_matrix(shape):
    matrix, _ = random(*shape)
    q, triangle, *_ = factored(matrix)
    assert np.array_equal(triangle, np.triu(triangle))
    assert (np.diag(triangle) > 0).all()
    np.testing.assert_allclose(triangle.T @ q, matrix, rtol=0, atol=1e-13)


@pytest.mark.parametrize("shape", SHAPES)
def test_residual_equals_that_of_least_squares(shape):
    matrix, target = random(*shape)
    q, _, projection, residual, _ = factored(matrix, target)
    np.testing.assert_allclose(q @ residual, 0, rtol=0, atol=1e-14)
    np.testing.assert_allclose(projection, q @ target, rtol=0, atol=1e-13)
    np.testing.assert_allclose(projection @ q + residual, target, rtol=0, atol=1e-14)


@pytest.mark.parametrize("left", [1e-6, 1e-10])
def test_small_residual_is_orthogonal_to_its_last_digits(left):
    matrix, noise = random(6, 800)
    q, _, _, residual, _ = factored(matrix, np.arange(1.0, 7.0) @ matrix + left * noise)
    assert np.linalg.norm(residual) < 2 * left * np.linalg.norm(noise)
    assert np.abs(q @ residual).max() < 1e-14 * np.linalg.norm(residual)


@pytest.mark.parametrize("condition", [1e4, 1e8, 1e10])
def test_nearly_parallel_columns_stay_orthogonal(condition):
    matrix, target = nearly_parallel(condition)
    q, triangle, _, residual, dependent = factored(matrix, target)
    assert dependent == -1
    assert np.linalg.cond(matrix) > condition / 10
    assert np.abs(q @ q.T - np.eye(len(q))).max() < 1e-13
    assert np.abs(q @ residual).max() < 1e-13
    np.testing.assert_allclose(triangle.T @ q, matrix, rtol=0, atol=1e-13)


@pytest.mark.parametrize("rows", [10, 257, 1000])
def test_rows_of_zeros_before_and_after_change_no_bit(rows):
    matrix, target = random(5, rows)
    added = np.zeros((5, 512))
    here = factored(matrix, target)
    there = factored(np.hstack([added, matrix, added]), np.hstack([added[0], target, added[0]]))
    for place in (0, 3):
        assert np.array_equal(there[place][..., 512 : 512 + rows], here[place])
    assert np.array_equal(there[1], here[1])
    assert np.array_equal(there[2], here[2])


def test_columns_of_one_segment_each_become_orthonormal_with_columns_of_all():
    matrix, target = random(8, 1500)
    for column, (first, last) in enumerate([(0, 700), (1, 700), (700, 1100), (702, 1100), (1100, 1500)]):
        matrix[column, :first] = matrix[column, last:] = 0.0
    q, triangle, projection, residual, dependent = factored(matrix, target)
    assert dependent == -1
    assert not triangle[:2, 2:5].any()
    np.testing.assert_allclose(q @ q.T, np.eye(8), rtol=0, atol=1e-14)
    np.testing.assert_allclose(triangle.T @ q, matrix, rtol=0, atol=1e-13)
    np.testing.assert_allclose(projection @ q + residual, target, rtol=0, atol=1e-14)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_non_finite_column_is_reported(value):
    matrix, target = random(4, 300)
    matrix[2, 17] = value
    assert factored(matrix, target)[-1] == 2
