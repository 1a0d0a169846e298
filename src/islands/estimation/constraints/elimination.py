"""Gauss-Jordan elimination of the rows of ``S theta = c``."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: A coefficient that is smaller relative to the numbers it is computed from is a rounding error.
_ROUNDING = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """Parameters that the others determine: ``theta[pivot] = fixed - sum of share * theta``.

    Attributes
    ----------
    rows : tuple of int
        Independent rows of S. The others follow from them.
    pivots : tuple of int
        Column that each of these rows determines.
    share : ndarray, shape (rank, columns)
        Shares of the other columns; the column of every pivot is a unit vector.
    fixed : ndarray, shape (rank,)
    """

    rows: tuple[int, ...]
    pivots: tuple[int, ...]
    share: NDArray[np.float64]
    fixed: NDArray[np.float64]

    @property
    def zeros(self) -> tuple[int, ...]:
        """Columns whose parameter is zero in every solution."""
        return tuple(
            pivot
            for pivot, share, fixed in zip(self.pivots, self.share, self.fixed, strict=True)
            if fixed == 0.0 and np.count_nonzero(share) == 1
        )


def eliminate(S: NDArray[np.float64], c: NDArray[np.float64], first: bool = False) -> Elimination | int:
    """Eliminate one parameter for every independent row.

    Parameters
    ----------
    S : ndarray, shape (rows, columns)
    c : ndarray, shape (rows,)
    first : bool
        Whether the pivot of a row is its first column; by default it is the one with the largest coefficient.

    Returns
    -------
    Elimination or int
        The number of a row that contradicts those before it.
    """
    share: NDArray[np.float64] = np.empty((0, S.shape[1]))
    fixed: NDArray[np.float64] = np.empty(0)
    rows: list[int] = []
    pivots: list[int] = []
    for row, target in enumerate(c):
        weights = S[row, pivots]
        coefficients = S[row] - weights @ share
        coefficients[
            np.abs(coefficients) <= _ROUNDING * (np.abs(S[row]) + np.abs(weights) @ np.abs(share))
        ] = 0
        rest = target - weights @ fixed
        if abs(rest) <= _ROUNDING * (abs(target) + np.abs(weights) @ np.abs(fixed)):
            rest = 0.0
        if not coefficients.any():
            if rest:
                return row
            continue
        pivot = int(np.argmax(coefficients != 0.0 if first else np.abs(coefficients)))
        new, value = coefficients / coefficients[pivot], rest / coefficients[pivot]
        factors = share[:, pivot].copy()
        moved, shifted = np.outer(factors, new), factors * value
        size, height = np.abs(share) + np.abs(moved), np.abs(fixed) + np.abs(shifted)
        share, fixed = share - moved, fixed - shifted
        share[np.abs(share) <= _ROUNDING * size] = 0.0
        fixed[np.abs(fixed) <= _ROUNDING * height] = 0.0
        share, fixed = np.vstack([share, new]), np.append(fixed, value)
        rows.append(row)
        pivots.append(pivot)
    return Elimination(tuple(rows), tuple(pivots), share, fixed)
