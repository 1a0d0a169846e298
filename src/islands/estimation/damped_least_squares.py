"""Minimisation of a sum of squares by damped Gauss-Newton steps (Levenberg 1944, Marquardt 1963).

The steps are restricted to directions along which the constraints on the parameters remain satisfied. Inner
products are summed in a written order, so that a result has the same bits on every number of threads.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from islands.estimation.constrained_least_squares import null_space
from islands.estimation.constraints.conditions import Constrained
from islands.kernels.gram import gram_of_residual
from islands.kernels.summation import dot
from islands.simulation.outcome import EvaluationOutcome

#: Step of a central difference in units of the parameters' magnitudes, a compromise between truncation and
#: rounding errors.
_DIFFERENCE_STEP = 1e-5

#: Directions whose differences are simulated together: the residuals of all would need much memory.
_AT_ONCE = 16

#: Initial damping, its factors after a failed and a successful step, and the value at which the steps end.
#: The regressors of an oversampled record depend on each other almost, so that a damping of 1e-3 holds the
#: parameters for several steps. A step that fails costs one simulation, one that is too short many.
_DAMPING, _INCREASE, _DECREASE, _MAX_DAMPING = 1e-8, 10.0, 0.2, 1e9


class Residual(Protocol):
    """Error of a simulation as a function of its parameters."""

    def __call__(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return simulation minus measurement, shape (samples,); None after a divergence."""

    def differentiate(
        self, theta: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the derivatives along directions, shape (free, samples), at parameters without divergence.

        A direction along which the simulation diverges has zeros.
        """


class Minimisation:
    """Minimisation of the mean square of a residual, which may be continued.

    Parameters
    ----------
    residual : Residual
    theta, error : ndarray, shapes (terms,) and (samples,)
        Parameters at the start, and the residual there.
    directions : ndarray, shape (terms, free)
        Directions of the steps. Its columns have the magnitudes of the parameters.
    min_gain : float
        The minimisation ends when a step reduces the mean square by a smaller relative amount.
    is_allowed : callable
        Whether a step to these parameters may be accepted.

    Attributes
    ----------
    theta, error : ndarray
        Parameters after the last accepted step, and the residual there.
    steps : int
        Number of accepted steps.
    gain : float
        Part of the mean square by which the last accepted step reduced it; infinite before the first.
    """

    def __init__(
        self,
        residual: Residual,
        theta: NDArray[np.float64],
        error: NDArray[np.float64],
        directions: NDArray[np.float64],
        min_gain: float,
        is_allowed: Callable[[NDArray[np.float64]], bool] = lambda _theta: True,
    ) -> None:
        self.theta, self.error, self.steps = theta, error, 0
        self._residual, self._directions = residual, directions
        self._min_gain, self._is_allowed = min_gain, is_allowed
        self._damping, self.gain = _DAMPING, np.inf
        self._normal: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    @property
    def has_ended(self) -> bool:
        """Whether further steps would not reduce the mean square noticeably."""
        return self.gain < self._min_gain or self._damping >= _MAX_DAMPING

    def advance(self, max_steps: int, stop: Callable[[], bool] = lambda: False) -> None:
        """Take steps up to a number of accepted ones from the start.

        Parameters
        ----------
        max_steps : int
        stop : callable
            Called before each step. Once it returns true, the steps end.
        """
        while self.steps < max_steps and not self.has_ended and not stop():
            if self._normal is None:
                self._normal = normal_equations(self._residual, self.theta, self.error, self._directions)
            normal, gradient = self._normal
            with np.errstate(over="ignore", invalid="ignore"):
                damped = normal + self._damping * np.diag(np.maximum(np.diag(normal), np.finfo(float).tiny))
            if not (np.isfinite(damped).all() and np.isfinite(gradient).all()):
                # No damping makes a step that small. The singular values of infinite numbers never converge.
                self._damping = _MAX_DAMPING
                return
            candidate = self.theta - self._directions @ np.linalg.lstsq(damped, gradient, rcond=None)[0]
            trial = self._residual(candidate) if self._is_allowed(candidate) else None
            if trial is None or not mean_square(trial) < mean_square(self.error):
                self._damping *= _INCREASE
                continue
            self.gain = 1.0 - mean_square(trial) / mean_square(self.error)
            self.theta, self.error, self._normal = candidate, trial, None
            self._damping *= _DECREASE
            self.steps += 1


def find_directions(
    theta: NDArray[np.float64], constrained: Constrained, scale: NDArray[np.float64] | None = None
) -> NDArray[np.float64] | EvaluationOutcome:
    """Return the directions along which the constraints hold, shape (terms, free); INFEASIBLE without any.

    Parameters
    ----------
    theta : ndarray, shape (terms,)
    constrained : Constrained
    scale : ndarray, shape (terms, terms), optional
        Steps of similar size, one for each column; by default those of `scale_parameters`.
    """
    scale = np.diag(scale_parameters(theta)) if scale is None else scale
    found = null_space(constrained.S @ scale, constrained.c)
    return found if isinstance(found, EvaluationOutcome) else scale @ found[1]


def scale_parameters(theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the magnitudes of parameters, which differ by many orders; 1 for a parameter that is 0."""
    return np.where(theta == 0.0, 1.0, np.abs(theta))


def approximate_jacobian(
    evaluate: Callable[[NDArray[np.float64]], list[NDArray[np.float64] | None]],
    theta: NDArray[np.float64],
    samples: int,
    directions: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the derivatives of a residual along directions, by central differences.

    Parameters
    ----------
    evaluate : callable
        Returns the residual of each of several parameter vectors, shape (vectors, terms); None after a
        divergence.

    Returns
    -------
    ndarray, shape (free, samples)
        A row is zero if the simulation diverges next to theta.
    """
    jacobian: NDArray[np.float64] = np.zeros((directions.shape[1], samples))
    for first in range(0, directions.shape[1], _AT_ONCE):
        steps = directions.T[first : first + _AT_ONCE]
        moved = [theta + sign * _DIFFERENCE_STEP * step for step in steps for sign in (1.0, -1.0)]
        found = evaluate(np.array(moved))
        rows = jacobian[first : first + _AT_ONCE]
        for row, forward, backward in zip(rows, found[::2], found[1::2], strict=True):
            if forward is not None and backward is not None:
                row[:] = (forward - backward) / (2.0 * _DIFFERENCE_STEP)
    return jacobian


def normal_equations(
    residual: Residual,
    theta: NDArray[np.float64],
    error: NDArray[np.float64],
    directions: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return J'J and J'r for steps along the directions; a direction that diverges contributes zeros."""
    return inner_products(residual.differentiate(theta, directions), error, 0, error.size)


def inner_products(
    jacobian: NDArray[np.float64], error: NDArray[np.float64], first: int, last: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return J'J and J'r over the samples ``first`` to ``last - 1``; J is given transposed."""
    free = len(jacobian)
    products: NDArray[np.float64] = np.empty((free + 1, free + 1))
    gram_of_residual(jacobian, error, first, last, products)
    return products[:free, :free], products[:free, free]


def mean_square(error: NDArray[np.float64]) -> float:
    """Return the mean square of a residual."""
    return float(dot(error, 0, error, 0, error.size)) / error.size
