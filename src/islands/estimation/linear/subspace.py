"""Poles and outputs of a state space from a frequency response: all orders by one factorisation.

McKelvey, Akcay and Ljung, Subspace-based multivariable system identification from frequency response data,
IEEE Transactions on Automatic Control 41 (1996) 960, algorithm 2, for frequencies at any distances.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.estimation.linear.frequency_response import FrequencyResponse

Matrix = NDArray[np.float64]

#: Block rows of the Hankel matrix beyond those that the largest order needs.
_FURTHER_ROWS = 4


@dataclass(frozen=True, slots=True, eq=False)
class ObservedSubspace:
    """Extended observability matrix of the largest order; its first columns are those of smaller ones.

    Attributes
    ----------
    vectors : ndarray, shape (rows * outputs, order)
    values : ndarray, shape (order,)
        Singular values.
    outputs : int
    """

    vectors: Matrix
    values: Matrix
    outputs: int

    def find_states(self, order: int) -> tuple[Matrix, Matrix]:
        """Return A, with unstable poles mirrored into the unit circle, and C of an order."""
        observed = self.vectors[:, :order]
        found = np.linalg.lstsq(observed[: -self.outputs], observed[self.outputs :], rcond=None)[0]
        a = np.asarray(found, np.float64)
        poles, vectors = np.linalg.eig(a)
        size = np.abs(poles)
        if (size >= 1.0).any():
            mirrored = np.where(size >= 1.0, poles / np.maximum(size, 1.0 + 1e-9) ** 2, poles)
            a = (vectors @ np.diag(mirrored) @ np.linalg.inv(vectors)).real
        return a, observed[: self.outputs]


def find_subspace(response: FrequencyResponse, max_order: int) -> ObservedSubspace:
    """Return the subspace of the states that a frequency response shows.

    Parameters
    ----------
    response : FrequencyResponse
    max_order : int
    """
    lines, outputs, inputs = response.values.shape
    rows = -(-max_order // outputs) + _FURTHER_ROWS
    rows = max(min(max_order + _FURTHER_ROWS, lines * inputs // (outputs + inputs)), rows)
    powers = np.exp(1j * np.outer(np.arange(rows), response.frequencies))
    # A line weighs as much as its error in the free run of scaled outputs.
    root = np.linalg.cholesky(response.power)
    deviations = np.sqrt(response.variances)[:, None]
    weighted = response.values @ root / deviations
    of_outputs = np.einsum("rf,foi->rofi", powers, weighted).reshape(rows * outputs, -1)
    of_inputs = np.einsum("rf,fki->rkfi", powers, root).reshape(rows * inputs, -1)
    stacked = np.vstack([of_inputs, of_outputs])
    triangle = np.asarray(np.linalg.qr(np.hstack([stacked.real, stacked.imag]).T, mode="r"))
    free = triangle[rows * inputs :, rows * inputs :].T
    vectors, values, _ = np.linalg.svd(free)
    order = min(max_order, (rows - 1) * outputs)
    scaled = vectors[:, :order].reshape(rows, outputs, order) * deviations
    return ObservedSubspace(scaled.reshape(rows * outputs, order), values[:order], outputs)
