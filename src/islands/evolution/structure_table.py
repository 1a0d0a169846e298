"""Table of evaluated structures: sets of terms with their parameters and errors, as rows of arrays."""

import numpy as np
from numpy.typing import NDArray

from islands.kernels.population import SelectedTerms

#: Approximate memory of the key of a structure, in bytes.
_KEY_BYTES = 200

#: Status of a structure that is not evaluated.
UNKNOWN = -1

#: Mark of an element after the last term; it differs from `islands.evolution.gene_index.ZERO`.
_NO_TERM = -2


class StructureTable:
    """Structures, that is sets of terms that remain after pruning and constraints, and their evaluations.

    The table only grows. Numbers of structures follow the order of insertion; no result may depend on them.

    Attributes
    ----------
    terms : ndarray of int64, shape (room, most terms)
        Numbers of the terms, ordered by content; `_NO_TERM` after the last.
    lengths : ndarray of int64, shape (room,)
        Number of terms.
    theta : ndarray of float64, shape (room, most terms)
        Parameters of the terms of a structure that was evaluated to the end.
    fitness : ndarray of float64, shape (room,)
        Mean squared error; a lower bound if the evaluation was abandoned.
    status : ndarray of int64, shape (room,)
        Status code of `islands.kernels.population`, or `UNKNOWN`.
    """

    def __init__(self) -> None:
        self._known: dict[bytes, int] = {}
        self.terms: NDArray[np.int64] = np.full((64, 0), _NO_TERM)
        self.lengths: NDArray[np.int64] = np.zeros(64, np.int64)
        self.theta: NDArray[np.float64] = np.zeros((64, 0))
        self.fitness: NDArray[np.float64] = np.zeros(64)
        self.status: NDArray[np.int64] = np.full(64, UNKNOWN)

    def __len__(self) -> int:
        return len(self._known)

    @property
    def bytes(self) -> int:
        """Approximate memory of the table, in bytes."""
        return len(self) * (_KEY_BYTES + 16 * int(self.terms.shape[1]) + 24)

    def number(self, structures: SelectedTerms) -> list[int]:
        """Return the numbers of some structures; add those that are new."""
        known, numbers = self._known, []
        self._make_room(*structures.terms.shape)
        for terms, length in zip(structures.terms, structures.lengths.tolist(), strict=True):
            key = terms[:length].tobytes()
            number = known.get(key)
            if number is None:
                number = known[key] = len(known)
                self.terms[number, :length], self.lengths[number] = terms[:length], length
            numbers.append(number)
        return numbers

    def select(self, numbers: NDArray[np.int64]) -> SelectedTerms:
        """Return the terms of some structures."""
        return SelectedTerms(self.terms[numbers], self.lengths[numbers])

    def _make_room(self, count: int, most: int) -> None:
        """Make room for some more structures with at most some number of terms."""
        rows, columns = self.terms.shape
        more = max(len(self) + count - rows, 0) and max(rows, count)
        wider = max(most - columns, 0)
        if more or wider:
            around = ((0, more), (0, wider))
            self.terms = np.pad(self.terms, around, constant_values=_NO_TERM)
            self.theta = np.pad(self.theta, around)
            self.lengths = np.pad(self.lengths, (0, more))
            self.fitness = np.pad(self.fitness, (0, more))
            self.status = np.pad(self.status, (0, more), constant_values=UNKNOWN)
