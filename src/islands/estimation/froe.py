"""Forward orthogonal regression by error reduction ratio (FROE), equation (6), on inner products alone.

Selecting the regressor with the largest error reduction ratio and orthogonalising the others against it is a
Cholesky factorisation of the Gram matrix, pivoted by that ratio: rows of the record are never touched again.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: A candidate whose squared norm has shrunk to this share can't be told from those selected: in float64 the
#: Gram matrix knows sixteen digits of the squares, so less than six of what is left.
DEPENDENT = 1e-10


@dataclass(frozen=True, slots=True)
class Selection:
    """Candidates in the order of their selection.

    Attributes
    ----------
    order : tuple of int
        Positions among the candidates.
    err : tuple of float
        Error reduction ratio of each: the share of the target's sum of squares that it explains on top of
        those before it. They sum to 1 at most.
    """

    order: tuple[int, ...]
    err: tuple[float, ...]


def froe(gram: NDArray[np.float64], tolerance: float = 0.0, max_terms: int | None = None) -> Selection:
    """Select candidates one after the other, each time the one with the largest error reduction ratio.

    Parameters
    ----------
    gram : ndarray, shape (candidates + 1, candidates + 1)
        Inner products of the candidates and, last, the target.
    tolerance : float
        Stop when no candidate left has a larger error reduction ratio.
    max_terms : int or None
        Stop at this number.

    Returns
    -------
    Selection
        With n terms it begins the selection with n + 1. Ties go to the first candidate.
    """
    candidates = len(gram) - 1
    norms = np.diag(gram)
    # What is zero, or too large for its square to be a number, explains nothing and spoils nothing.
    usable = (norms > 0.0) & np.isfinite(norms)
    gram = np.where(usable[:, None] & usable, gram, 0.0)
    energy = gram[-1, -1]
    scale = 1.0 / np.sqrt(np.where(usable, norms, 1.0))[:-1]
    scaled = gram[:-1, :-1] * scale[:, None] * scale
    correlation = gram[:-1, -1] * scale
    left = usable[:-1].astype(float)
    rows = np.empty((0, candidates))
    order: list[int] = []
    err: list[float] = []
    limit = candidates if max_terms is None else min(max_terms, candidates)
    while len(order) < limit and energy > 0.0:
        free = left > DEPENDENT
        ratio = np.where(free, correlation**2 / np.where(free, left, 1.0), -1.0) / energy
        best = int(np.argmax(ratio))
        if not ratio[best] > tolerance:
            break
        row = (scaled[best] - np.sum(rows[:, best, None] * rows, axis=0)) / np.sqrt(left[best])
        correlation = correlation - row * (correlation[best] / row[best])
        left = left - row**2
        left[best] = 0.0
        rows = np.vstack([rows, row])
        order.append(best)
        err.append(float(ratio[best]))
    return Selection(tuple(order), tuple(err))


def prune(gram: NDArray[np.float64], tolerance: float) -> tuple[int, ...]:
    """Return the positions, ascending, of the regressors whose error reduction ratio exceeds the tolerance.

    Parameters
    ----------
    gram : ndarray, shape (terms + 1, terms + 1)
        Inner products of an individual's regressors and, last, the target (the paper, section 5.2).
    """
    # All are orthogonalised before any leaves (the paper, section 2): one that explains little by itself may
    # let the next explain much.
    found = froe(gram)
    return tuple(sorted(item for item, err in zip(found.order, found.err, strict=True) if err > tolerance))
