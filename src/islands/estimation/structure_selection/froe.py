"""Forward orthogonal regression by error reduction ratio (FROE), equation (6), from inner products."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.kernels.err_selection import select


@dataclass(frozen=True, slots=True)
class Selection:
    """Candidates in order of selection.

    Attributes
    ----------
    order : tuple of int
        Positions among the candidates.
    err : tuple of float
        Error reduction ratio of each candidate: the fraction of the target's sum of squares that it explains
        in addition to those selected before. The ratios sum to at most 1.
    """

    order: tuple[int, ...]
    err: tuple[float, ...]


def froe(gram: NDArray[np.float64], tolerance: float = 0.0, max_terms: int | None = None) -> Selection:
    """Select candidates one by one, each time the one with the largest error reduction ratio.

    Parameters
    ----------
    gram : ndarray, shape (candidates + 1, candidates + 1)
        Inner products of the candidates and, in the last row and column, of the target.
    tolerance : float
        Stop if no remaining candidate has a larger error reduction ratio.
    max_terms : int or None
        Maximum number of selected candidates.

    Returns
    -------
    Selection
        A selection of n terms is a prefix of the selection of n + 1 terms. Ties go to the first candidate.
        Candidates that depend linearly on those selected before are not selected.
    """
    candidates = len(gram) - 1
    limit = candidates if max_terms is None else min(max_terms, candidates)
    order, err = np.empty(limit, np.int64), np.empty(limit)
    count = select(np.ascontiguousarray(gram, np.float64), candidates, tolerance, limit, order, err)
    return Selection(tuple(order[:count].tolist()), tuple(err[:count].tolist()))
