"""Derivatives of predictions with respect to the parameters of a model."""

from collections.abc import Sequence
from copy import copy

import numpy as np
from numpy.typing import NDArray

from islands.expressions.output_derivatives import OutputDerivative, differentiate_by_outputs
from islands.expressions.primitives import MUL
from islands.expressions.tree import Apply, Constant, Expression
from islands.kernels.sensitivities import WIDTHS, Slopes, SparseDirections, compute_sensitivities
from islands.models.regressor import Regressor
from islands.program.term_pool import link
from islands.records.dataset import Dataset
from islands.simulation.layout import layout

#: A derivative whose sum of squares is larger is set to zero: products of such derivatives overflow.
_LARGEST_SQUARE = 1e300


class Sensitivities:
    """Derivatives of the predictions of a model, with the program and the layout for many parameters.

    Parameters
    ----------
    regressors : sequence of Regressor
    products : sequence of (int, OutputDerivative)
        Derivatives of the regressors with respect to past outputs, each with the place of its regressor.
    record, warm_up, interval
        As for `layout`.
    """

    def __init__(
        self,
        regressors: Sequence[Regressor],
        products: Sequence[tuple[int, OutputDerivative]],
        record: Dataset,
        warm_up: int,
        interval: int | None,
    ) -> None:
        # One-step-ahead predictions read measured outputs, which do not depend on the parameters.
        products = [] if interval == 1 else sorted(products, key=lambda product: product[1].lag)
        self._program = link([*regressors, *(_multiply(derivative.factors) for _, derivative in products)])
        self._terms = np.array([term for term, _ in products], np.int64)
        self._weights = np.array([derivative.weight for _, derivative in products])
        lags, counts = np.unique(
            np.array([derivative.lag for _, derivative in products], np.int64), return_counts=True
        )
        self._lags, self._ends = lags, np.cumsum(counts, dtype=np.int64)
        self._limits = warm_up, interval
        self._record, self._cut = record, layout(record, warm_up, interval, WIDTHS)
        starts = np.argsort(self._cut.start)
        ends = np.cumsum(self._cut.length[starts])
        self._place = np.empty_like(ends)
        self._place[starts] = ends - self._cut.length[starts]
        self._predictions = int(ends[-1])

    def with_record(self, record: Dataset) -> "Sensitivities":
        """Return the derivatives on the same record with other initial outputs."""
        if record is self._record:
            return self
        found = copy(self)
        found._record, found._cut = record, layout(record, *self._limits, WIDTHS)
        return found

    def __call__(self, theta: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of all predictions along directions.

        Parameters
        ----------
        theta : ndarray, shape (terms,)
            Parameters at which the simulation does not diverge.
        directions : ndarray, shape (terms, free)

        Returns
        -------
        ndarray, shape (free, predictions)
            In the order of time. A derivative whose squares overflow is zero.
        """
        along, terms = np.nonzero(directions.T)
        ends = np.cumsum(np.count_nonzero(directions, axis=0), dtype=np.int64)
        found = np.empty((directions.shape[1], self._predictions))
        compute_sensitivities(
            self._program,
            theta,
            Slopes(self._weights * theta[self._terms], self._lags, self._ends),
            SparseDirections(terms, directions[terms, along], ends),
            self._cut,
            self._place,
            found,
        )
        found[~(np.einsum("ij,ij->i", found, found) < _LARGEST_SQUARE)] = 0.0
        return found


def make_sensitivities(
    regressors: Sequence[Regressor], record: Dataset, warm_up: int, interval: int | None
) -> Sensitivities | None:
    """Return the `Sensitivities` of a model; None if a regressor has no known derivative."""
    products: list[tuple[int, OutputDerivative]] = []
    for term, regressor in enumerate(regressors):
        derivatives = differentiate_by_outputs(regressor.expression)
        if derivatives is None:
            return None
        products += [(term, derivative) for derivative in derivatives]
    return Sensitivities(regressors, products, record, warm_up, interval)


def _multiply(factors: tuple[Expression, ...]) -> Expression:
    if len(factors) > 1:
        return Apply(MUL, factors)
    return factors[0] if factors else Constant(1.0)
