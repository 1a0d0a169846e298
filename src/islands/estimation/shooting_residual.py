"""Multiple-shooting residual of a model: values, derivatives and inner products in a fixed order."""

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.kernels.simulation.simulate import DIVERGED, Layout, simulate
from islands.kernels.summation import dot
from islands.model.model import Model
from islands.program.term_pool import link
from islands.simulation.layout import layout
from islands.simulation.predictors import divergence_bound

#: Step of a central difference in units of the parameters' magnitudes, a compromise between truncation and
#: rounding errors.
_DIFFERENCE_STEP = 1e-5


class ShootingResidual:
    """The multiple-shooting residual of a model as a function of its parameters.

    Parameters
    ----------
    model : Model
        Model whose free parameters are passed to the calls.
    record : Dataset
        Record without missing outputs.
    interval : int or None
        Length of a shooting interval in samples: 1 is one-step-ahead, None is the free run.
    warm_up : int or None
        Number of samples before the first prediction. None is the largest lag.
    """

    def __init__(self, model: Model, record: Dataset, interval: int | None, warm_up: int | None) -> None:
        first = model.maximum_lag if warm_up is None else warm_up
        self._program = link(model.regressors)
        self._cut: Layout = layout(record, first, interval)
        self._y, self._bound = record.y, divergence_bound(record)
        self._predicted = np.zeros(record.samples, bool)
        for start, length in zip(self._cut.start, self._cut.length, strict=True):
            self._predicted[start : start + length] = True
        #: Number of samples of every interval, in the order of time.
        self.intervals = self._cut.length[np.argsort(self._cut.start)]

    def __call__(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return prediction minus measurement over all predicted samples, or None after a divergence."""
        lanes = len(self._cut.start)
        predicted = np.empty(len(self._y))
        error, diverged = np.empty(lanes), np.empty(lanes, np.int64)
        ending = simulate(
            self._program, theta, self._cut, self._bound, np.inf, False, error, diverged, predicted
        )
        if ending == DIVERGED:
            return None
        # The memory of other samples is not initialised: differences of it may overflow.
        return predicted[self._predicted] - self._y[self._predicted]

    def mean_square(self, error: NDArray[np.float64]) -> float:
        """Return the mean square of a residual."""
        return float(dot(error, 0, error, 0, error.size)) / error.size

    def jacobian(self, theta: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the residual along directions of the parameters.

        Parameters
        ----------
        theta : ndarray, shape (terms,)
        directions : ndarray, shape (terms, free)
            Its columns have the magnitudes of the parameters; they scale the step of the central difference.

        Returns
        -------
        ndarray, shape (free, predicted samples)
            A row is zero if the simulation diverges next to theta.
        """
        free = directions.shape[1]
        derivatives: NDArray[np.float64] = np.zeros((free, int(self._predicted.sum())))
        for j in range(free):
            forward, backward = (
                self(theta + sign * _DIFFERENCE_STEP * directions[:, j]) for sign in (1.0, -1.0)
            )
            if forward is not None and backward is not None:
                derivatives[j] = (forward - backward) / (2.0 * _DIFFERENCE_STEP)
        return derivatives

    def normal_equations(
        self, theta: NDArray[np.float64], error: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return J'J and J'r for steps along the directions; a direction that diverges contributes zeros."""
        return inner_products(self.jacobian(theta, directions), error, 0, error.size)


def inner_products(
    jacobian: NDArray[np.float64], error: NDArray[np.float64], first: int, last: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return J'J and J'r over the samples ``first`` to ``last - 1``; J is given transposed."""
    free, samples = jacobian.shape
    normal: NDArray[np.float64] = np.empty((free, free))
    gradient: NDArray[np.float64] = np.empty(free)
    flat, rows = jacobian.reshape(-1), last - first
    for i in range(free):
        gradient[i] = dot(flat, i * samples + first, error, first, rows)
        for j in range(i + 1):
            normal[i, j] = normal[j, i] = dot(flat, i * samples + first, flat, j * samples + first, rows)
    return normal, gradient
