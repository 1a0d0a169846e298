"""Forward orthogonal regression by error reduction ratio (FROE), equation (6), on inner products alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.kernels.err_selection import select


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
    limit = candidates if max_terms is None else min(max_terms, candidates)
    order, err = np.empty(limit, np.int64), np.empty(limit)
    count = select(np.ascontiguousarray(gram, np.float64), candidates, tolerance, limit, order, err)
    return Selection(tuple(order[:count].tolist()), tuple(err[:count].tolist()))
