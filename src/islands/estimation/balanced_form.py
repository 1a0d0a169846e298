"""Balanced form of a linear system: its output shows a state as much as the inputs reach it.

The source is Moore, IEEE Trans. Autom. Control 26 (1981) 17-32. Modes that almost cancel each other are large
in the modal form, and small in this one.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

#: Largest magnitude of a pole in the Gramians, which an integrator does not have.
_LARGEST_POLE = 0.9995

#: Eigenvalues of a Gramian below this fraction of the largest are replaced by it.
_LEAST_EIGENVALUE = 1e-14


def find_balanced_form(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the transformation ``x = T z`` to balanced states z.

    Parameters
    ----------
    a, b, c : ndarray, shapes (states, states), (states, inputs) and (states,)
        Poles outside of the unit circle count as slow ones.

    Returns
    -------
    ndarray, shape (states, states)
        The identity if no input reaches a state.
    """
    radius = float(np.abs(np.linalg.eigvals(a)).max())
    stable = a * min(1.0, _LARGEST_POLE / max(radius, _LARGEST_POLE))
    reached = scipy.linalg.solve_discrete_lyapunov(stable, b @ b.T, method="bilinear")
    shown = scipy.linalg.solve_discrete_lyapunov(stable.T, np.outer(c, c), method="bilinear")
    values, vectors = np.linalg.eigh((reached + reached.T) / 2.0)
    if not values.max() > 0.0:
        return np.eye(len(a))
    root = vectors * np.sqrt(np.maximum(values, _LEAST_EIGENVALUE * values.max()))
    left, squares, _ = np.linalg.svd(root.T @ shown @ root)
    squares = np.maximum(squares, np.finfo(float).tiny)
    return np.asarray(root @ left / squares**0.25, np.float64)
