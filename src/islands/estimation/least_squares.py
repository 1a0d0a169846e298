"""Least squares, equation (2), through an orthogonal factorisation: no inverse is ever formed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from islands.errors import RecordError
from islands.kernels.qr import orthogonalise
from islands.kernels.summation import total
from islands.simulation.outcome import OK, EvaluationOutcome, Status

#: A regressor that keeps less than this share of its norm depends on those before it.
DEPENDENT = 1e-11


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Estimated parameters.

    Attributes
    ----------
    theta : ndarray, shape (terms,)
        NaN where the outcome is a failure.
    standard_errors : ndarray, shape (terms,)
        Square roots of the diagonal of the parameters' covariance, as if the equation error were white.
    residual_variance : float
        Residual sum of squares over rows less free parameters.
    outcome : EvaluationOutcome
        OK, SINGULAR, INFEASIBLE or TOO_FEW_ROWS.
    """

    theta: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    residual_variance: float
    outcome: EvaluationOutcome


@dataclass(frozen=True, slots=True, eq=False)
class QRFactor:
    """``Psi = Q R`` with the columns of R scaled to norm 1: all that estimation needs of a record.

    Attributes
    ----------
    triangle : ndarray, shape (terms, terms)
        R, upper triangular, each column divided by its norm.
    scale : ndarray, shape (terms,)
        Those norms: a parameter is the scaled one divided by it.
    projection : ndarray, shape (terms,)
        Q'y.
    residual : float
        Sum of squares of y that no parameters can explain.
    rows : int
        Rows of Psi.
    """

    triangle: NDArray[np.float64]
    scale: NDArray[np.float64]
    projection: NDArray[np.float64]
    residual: float
    rows: int


def factor(psi: NDArray[np.float64], y: NDArray[np.float64]) -> QRFactor | EvaluationOutcome:
    """Factor a regressor matrix.

    Parameters
    ----------
    psi : ndarray, shape (terms, rows)
        The regressor matrix, transposed.
    y : ndarray, shape (rows,)
        The target.

    Returns
    -------
    QRFactor or EvaluationOutcome
        TOO_FEW_ROWS, or SINGULAR with the position of the first regressor that depends on those before it.

    Raises
    ------
    RecordError
        The target has another number of rows: the kernel would read beyond its end.
    """
    terms, rows = psi.shape
    if y.shape != (rows,):
        raise RecordError(f"the regressor matrix has {rows} rows, the target has shape {y.shape}")
    if rows <= terms:
        return EvaluationOutcome(Status.TOO_FEW_ROWS, f"{rows} rows for {terms} parameters")
    triangle, projection = np.empty((terms, terms)), np.empty(terms)
    # The kernel works in place on contiguous rows of float64; the caller's may be a transposed view.
    q, residual = np.array(psi, dtype=np.float64, order="C"), np.array(y, dtype=np.float64)
    dependent = orthogonalise(q, residual, triangle, projection, DEPENDENT)
    if dependent >= 0:
        return EvaluationOutcome(Status.SINGULAR, f"regressor {dependent + 1} depends on those before it")
    scale = np.sqrt(np.sum(triangle**2, axis=0))
    return QRFactor(triangle / scale, scale, projection, float(total(residual**2)), rows)


def least_squares(psi: NDArray[np.float64], y: NDArray[np.float64]) -> Estimate:
    """Estimate the parameters that minimise ``|y - Psi theta|``.

    Parameters
    ----------
    psi : ndarray, shape (terms, rows)
        The regressor matrix, transposed.
    y : ndarray, shape (rows,)
        The target.
    """
    made = factor(psi, y)
    if isinstance(made, EvaluationOutcome):
        return failed_estimate(len(psi), made)
    return solve(made, np.zeros(len(psi)), np.eye(len(psi)))


def solve(made: QRFactor, particular: NDArray[np.float64], basis: NDArray[np.float64]) -> Estimate:
    """Minimise over ``scaled theta = particular + basis eta``.

    Parameters
    ----------
    particular : ndarray, shape (terms,)
        One admissible scaled parameter vector.
    basis : ndarray, shape (terms, free)
        Directions that keep it admissible, orthonormal.
    """
    terms, free = basis.shape
    remainder = made.projection - made.triangle @ particular
    if not free:
        return _estimate(made, particular, np.zeros((terms, terms)), float(remainder @ remainder), 0)
    q, r = qr(made.triangle @ basis, mode="economic")
    if np.abs(np.diag(r)).min() <= DEPENDENT:
        return failed_estimate(
            terms, EvaluationOutcome(Status.SINGULAR, "the free directions depend on each other")
        )
    right = q.T @ remainder
    scaled = particular + basis @ solve_triangular(r, right)
    spread = solve_triangular(r, basis.T, trans="T")
    missed = remainder - q @ right
    return _estimate(made, scaled, spread.T @ spread, float(missed @ missed), free)


def _estimate(
    made: QRFactor, scaled: NDArray[np.float64], covariance: NDArray[np.float64], missed: float, free: int
) -> Estimate:
    variance = (made.residual + missed) / (made.rows - free)
    errors = np.sqrt(variance * np.maximum(np.diag(covariance), 0.0)) / made.scale
    return Estimate(scaled / made.scale, errors, variance, OK)


def failed_estimate(terms: int, outcome: EvaluationOutcome) -> Estimate:
    """Return the estimate of a failure."""
    nothing = np.full(terms, np.nan)
    return Estimate(nothing, nothing, np.nan, outcome)
