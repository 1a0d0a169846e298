"""Constrained least squares, equation (4), in the null space of the constraints.

``theta = theta_p + Z eta`` with ``S Z = 0`` meets ``S theta = c`` for every eta, so the constraints hold for
any data. The result equals equation (4) but needs none of its three inverses.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.estimation.least_squares import Estimate, factorise, failed_estimate, solve
from islands.simulation.outcome import EvaluationOutcome, Status

#: A normalised row of S with a smaller pivot is a linear combination of the other rows. Also the relative
#: tolerance of its right-hand side.
_REDUNDANT = 1e-10


def constrained_least_squares(
    psi: NDArray[np.float64],
    y: NDArray[np.float64],
    S: NDArray[np.float64],
    c: NDArray[np.float64],
    standard_errors: bool = True,
) -> Estimate:
    """Estimate the parameters that minimise ``|y - Psi theta|`` subject to ``S theta = c``.

    Parameters
    ----------
    psi : ndarray, shape (terms, rows)
        The regressor matrix, transposed.
    y : ndarray, shape (rows,)
        The target.
    S : ndarray, shape (constraints, terms)
        Constraint matrix. No row may be a linear combination of the others.
    c : ndarray, shape (constraints,)
        Right-hand side of the constraints.
    standard_errors : bool
        Whether to compute the standard errors; otherwise they are NaN.

    Returns
    -------
    Estimate
        INFEASIBLE if a constraint is zero or redundant or contradicts the others, or if there are more
        constraints than terms. TOO_FEW_ROWS or SINGULAR as in `factorise`.
    """
    factors = factorise(psi, y)
    if isinstance(factors, EvaluationOutcome):
        return failed_estimate(len(psi), factors)
    found = null_space(S / factors.scale, c)
    if isinstance(found, EvaluationOutcome):
        return failed_estimate(len(psi), found)
    return solve(factors, *found, standard_errors)


def null_space(
    S: NDArray[np.float64], c: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | EvaluationOutcome:
    """Return a particular solution of ``S theta = c`` and an orthonormal basis of the null space of S.

    Return INFEASIBLE with the number of a constraint that is zero, redundant or contradictory.
    """
    constraints, terms = S.shape
    if not constraints:
        return np.zeros(terms), np.eye(terms)
    norms = np.sqrt(np.sum(S**2, axis=1))
    if not norms.all():
        row = int(np.flatnonzero(norms == 0.0)[0])
        return EvaluationOutcome(Status.INFEASIBLE, f"constraint {row + 1} names no regressor")
    scaled, targets = S / norms[:, None], c / norms
    q, r, order = scipy.linalg.qr(scaled.T, pivoting=True)
    diagonal = np.abs(np.diag(r))
    rank = int(np.sum(diagonal > _REDUNDANT))
    particular = q[:, :rank] @ np.linalg.solve(r[:rank, :rank].T, targets[order[:rank]])
    if rank < constraints:
        row = order[rank]
        missed = abs(scaled[row] @ particular - targets[row])
        contradicts = missed > _REDUNDANT * (np.linalg.norm(particular) + abs(targets[row]))
        kind = "contradicts the others" if contradicts else "is a combination of the others: leave it out"
        return EvaluationOutcome(Status.INFEASIBLE, f"constraint {row + 1} {kind}")
    return particular, q[:, rank:]
