"""Constrained least squares from inner products alone: what a search can afford a million times.

The Gram matrix squares the condition of the regressor matrix. Where a pivot of its Cholesky factor gets too
small beside the regressors' own norms, the caller has to factor the columns; that depends on nothing but the
matrix.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from islands.estimation.constrained import null_space
from islands.simulation.outcome import Outcome

#: Squared pivots under this leave fewer than six digits of the parameters: a direction that the constraints
#: leave free (the difference of two neighbouring samples) has lost them before it is equilibrated.
ILL_CONDITIONED = 1e-10


def from_gram(
    gram: NDArray[np.float64], S: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.float64] | Outcome | None:
    """Estimate parameters under ``S theta = c`` from a Gram matrix.

    Parameters
    ----------
    gram : ndarray, shape (terms + 1, terms + 1)
        Inner products of the regressors and, last, the target.
    S : ndarray, shape (constraints, terms)
    c : ndarray, shape (constraints,)

    Returns
    -------
    ndarray, Outcome or None
        The parameters; the failure of the constraints; None where the matrix is too ill-conditioned.
    """
    norms = np.sqrt(np.diag(gram)[:-1])
    if not (np.isfinite(norms).all() and norms.all()):
        return None
    scaled = gram[:-1, :-1] / norms[:, None] / norms
    right = gram[:-1, -1] / norms
    found = null_space(S / norms, c)
    if isinstance(found, Outcome):
        return found
    particular, basis = found
    if not basis.shape[1]:
        return particular / norms
    reduced = basis.T @ scaled @ basis
    scale = 1.0 / np.sqrt(np.maximum(np.diag(reduced), np.finfo(float).tiny))
    try:
        lower = np.linalg.cholesky(reduced * scale[:, None] * scale)
    except np.linalg.LinAlgError:
        return None
    if (np.diag(lower) / scale).min() ** 2 < ILL_CONDITIONED:
        return None
    wanted = scale * (basis.T @ (right - scaled @ particular))
    eta = solve_triangular(lower, solve_triangular(lower, wanted, lower=True), trans="T", lower=True)
    theta: NDArray[np.float64] = (particular + basis @ (scale * eta)) / norms
    return theta
