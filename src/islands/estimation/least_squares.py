"""Least squares, equation (2), by an orthogonal factorisation without matrix inverses."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.estimation.covariance import sandwich
from islands.kernels.qr import orthogonalise
from islands.kernels.summation import total
from islands.simulation.outcome import OK, EvaluationOutcome, Status

#: A regressor is linearly dependent if orthogonalisation leaves a smaller fraction of its norm.
DEPENDENT = 1e-11


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Estimated parameters. All numbers are NaN after a failure.

    Attributes
    ----------
    theta : ndarray, shape (terms,)
    standard_errors : ndarray, shape (terms,)
        Square roots of the diagonal of the parameter covariance, which allows for a coloured residual:
        `islands.estimation.covariance`.
    residual_variance : float
        Residual sum of squares divided by (rows - free parameters).
    outcome : EvaluationOutcome
        OK, SINGULAR, INFEASIBLE or TOO_FEW_ROWS.
    """

    theta: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    residual_variance: float
    outcome: EvaluationOutcome


@dataclass(frozen=True, slots=True, eq=False)
class QRFactor:
    """Factorisation ``Psi = Q R`` with the columns of R scaled to norm 1.

    Attributes
    ----------
    triangle : ndarray, shape (terms, terms)
        R, upper triangular, each column divided by its norm.
    scale : ndarray, shape (terms,)
        Norms of the columns of R. A parameter is the scaled parameter divided by its norm.
    projection : ndarray, shape (terms,)
        Q'y.
    residual : float
        Sum of squares of the part of y that is orthogonal to Psi.
    columns : ndarray, shape (terms, rows)
        Q, transposed.
    orthogonal : ndarray, shape (rows,)
        The part of y that is orthogonal to Psi.
    """

    triangle: NDArray[np.float64]
    scale: NDArray[np.float64]
    projection: NDArray[np.float64]
    residual: float
    columns: NDArray[np.float64]
    orthogonal: NDArray[np.float64]


def factorise(psi: NDArray[np.float64], y: NDArray[np.float64]) -> QRFactor | EvaluationOutcome:
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
        TOO_FEW_ROWS, or SINGULAR with the position of the first linearly dependent regressor.

    Raises
    ------
    RecordError
        The target has a different number of rows; the kernel would read out of bounds.
    """
    terms, rows = psi.shape
    if y.shape != (rows,):
        raise RecordError(f"the regressor matrix has {rows} rows, the target has shape {y.shape}")
    if rows <= terms:
        return EvaluationOutcome(Status.TOO_FEW_ROWS, f"{rows} rows for {terms} parameters")
    triangle, projection = np.empty((terms, terms)), np.empty(terms)
    # The kernel works in place on contiguous float64 rows; the caller's array may be a transposed view.
    q, residual = np.array(psi, dtype=np.float64, order="C"), np.array(y, dtype=np.float64)
    dependent = orthogonalise(q, residual, triangle, projection, DEPENDENT)
    if dependent >= 0:
        return EvaluationOutcome(Status.SINGULAR, f"regressor {dependent + 1} depends on those before it")
    scale = np.sqrt(np.sum(triangle**2, axis=0))
    return QRFactor(triangle / scale, scale, projection, float(total(residual**2)), q, residual)


def least_squares(psi: NDArray[np.float64], y: NDArray[np.float64], standard_errors: bool = True) -> Estimate:
    """Estimate the parameters that minimise ``|y - Psi theta|``.

    Parameters
    ----------
    psi : ndarray, shape (terms, rows)
        The regressor matrix, transposed.
    y : ndarray, shape (rows,)
        The target.
    standard_errors : bool
        Whether to compute the standard errors, which takes as long as the parameters.
    """
    factors = factorise(psi, y)
    if isinstance(factors, EvaluationOutcome):
        return failed_estimate(len(psi), factors)
    return solve(factors, np.zeros(len(psi)), np.eye(len(psi)), standard_errors)


def solve(
    factors: QRFactor,
    particular: NDArray[np.float64],
    basis: NDArray[np.float64],
    standard_errors: bool = True,
) -> Estimate:
    """Minimise over ``scaled theta = particular + basis eta``.

    Parameters
    ----------
    factors : QRFactor
    particular : ndarray, shape (terms,)
        A scaled parameter vector that meets the constraints.
    basis : ndarray, shape (terms, free)
        Orthonormal basis of the directions that preserve the constraints.
    standard_errors : bool
        Whether to compute the standard errors; otherwise they are NaN.
    """
    terms, free = basis.shape
    remainder = factors.projection - factors.triangle @ particular
    if not free:
        return _make_estimate(factors, particular, np.zeros(terms), float(remainder @ remainder), 0)
    q, r = scipy.linalg.qr(factors.triangle @ basis, mode="economic")
    if np.abs(np.diag(r)).min() <= DEPENDENT:
        return failed_estimate(
            terms, EvaluationOutcome(Status.SINGULAR, "the free directions depend on each other")
        )
    right = q.T @ remainder
    scaled = particular + basis @ scipy.linalg.solve_triangular(r, right)
    unexplained = remainder - q @ right
    if not standard_errors:
        undefined = np.full(terms, np.nan)
        return _make_estimate(factors, scaled, undefined, float(unexplained @ unexplained), free)
    residual = factors.orthogonal + combine(unexplained[:, None], factors.columns)[0]
    covariance = sandwich(factors.columns, residual, weights=q)
    spread = scipy.linalg.solve_triangular(r, basis.T, trans="T")
    variances = np.einsum("it,ij,jt->t", spread, covariance, spread)
    return _make_estimate(factors, scaled, variances, float(unexplained @ unexplained), free)


def combine(weights: NDArray[np.float64], series: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``weights.T @ series`` with sums in a fixed order.

    Parameters
    ----------
    weights : ndarray, shape (series, combinations)
    series : ndarray, shape (series, rows)
    """
    combined: NDArray[np.float64] = np.zeros((weights.shape[1], series.shape[1]))
    for position, combination in zip(np.ndindex(weights.shape), np.ravel(weights), strict=True):
        if combination != 0.0:
            combined[position[1]] += combination * series[position[0]]
    return combined


def _make_estimate(
    factors: QRFactor,
    scaled: NDArray[np.float64],
    variances: NDArray[np.float64],
    unexplained: float,
    free: int,
) -> Estimate:
    variance = (factors.residual + unexplained) / (factors.columns.shape[1] - free)
    errors = np.sqrt(np.maximum(variances, 0.0)) / factors.scale
    return Estimate(scaled / factors.scale, errors, variance, OK)


def failed_estimate(terms: int, outcome: EvaluationOutcome) -> Estimate:
    """Return an estimate of NaN with the outcome of a failure."""
    undefined = np.full(terms, np.nan)
    return Estimate(undefined, undefined, np.nan, outcome)
