"""Least squares of the free run of a state space with static units, with free initial states.

Every segment has its initial states, which are eliminated from the normal equations: their block is
small and separate for each segment (Schur complement). Steps are damped (Levenberg 1944, Marquardt 1963).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from islands.kernels.state_space import accumulate_products
from islands.kernels.summation import dot
from islands.simulation.initial_states import Segment, simulate_errors

#: Initial damping, its factors after a failed and a successful step, its limits.
_DAMPING, _INCREASE, _DECREASE, _LEAST_DAMPING, _MAX_DAMPING = 1e-2, 4.0, 0.2, 1e-12, 1e8

#: The steps end after this number of steps with a smaller relative gain.
_PATIENCE, _MIN_GAIN = 4, 1e-5

#: Least norm of the derivatives for a parameter, relative to the median, by which the parameter is scaled.
_LEAST_SCALE = 1e-3


@dataclass(slots=True, eq=False)
class StateSpaceFit:
    """Fit of the parameters and of the initial states, which may be continued.

    Attributes
    ----------
    theta : ndarray, shape (parameters,)
        Parameters in the order of `islands.kernels.state_space`.
    places : ndarray of int64, shape (parameters,)
        Column of each free parameter; -1 for a fixed one.
    codes : ndarray of int64, shape (units,)
    segments : sequence of Segment
    states : ndarray, shape (segments, states)
        States at the first rows.
    mean_square : float
        Of the error over all measured outputs.
    gain : float
        Part by which the last accepted step reduced it.
    """

    theta: NDArray[np.float64]
    places: NDArray[np.int64]
    codes: NDArray[np.int64]
    segments: Sequence[Segment]
    states: NDArray[np.float64]
    mean_square: float = field(init=False)
    gain: float = field(init=False, default=np.inf)
    _damping: float = field(init=False, default=_DAMPING)

    def __post_init__(self) -> None:
        self.mean_square = self._measure(self.theta, self.states)

    def advance(self, steps: int, stop: Callable[[], bool] = lambda: False) -> None:
        """Take a number of steps, fewer if they no longer reduce the error noticeably."""
        stalled = 0
        for _ in range(steps):
            if stop() or not self._step():
                return
            stalled = stalled + 1 if self.gain < _MIN_GAIN else 0
            if stalled == _PATIENCE:
                return

    def release(self, places: NDArray[np.int64]) -> None:
        """Replace the free parameters."""
        self.places, self._damping, self.gain = places, _DAMPING, np.inf

    def _step(self) -> bool:
        products = self._accumulate()
        if products is None:
            return False
        while self._damping <= _MAX_DAMPING:
            theta, states = self._move(products)
            found = self._measure(theta, states)
            if found < self.mean_square:
                self.gain = 1.0 - found / self.mean_square
                self.theta, self.states, self.mean_square = theta, states, found
                self._damping = max(_LEAST_DAMPING, self._damping * _DECREASE)
                return True
            self._damping *= _INCREASE
        return False

    def _measure(self, theta: NDArray[np.float64], states: NDArray[np.float64]) -> float:
        total, count = 0.0, 0
        for segment, start in zip(self.segments, states, strict=True):
            error = simulate_errors(theta, self.codes, segment, start)
            if error is None:
                return np.inf
            error = error[~np.isnan(error)]
            total += float(dot(error, 0, error, 0, error.size))
            count += error.size
        return total / max(1, count)

    def _accumulate(self) -> list[NDArray[np.float64]] | None:
        columns = int(self.places.max()) + 1
        size = columns + self.states.shape[1] + 1
        found = []
        for segment, start in zip(self.segments, self.states, strict=True):
            products = np.empty((size, size))
            rows = accumulate_products(
                *(self.theta, self.places, self.codes, segment.u, start),
                *(segment.y, segment.lower, segment.upper, columns, products),
            )
            if rows < len(segment.y) or not np.isfinite(products).all():
                return None
            found.append(products)
        return found

    def _move(
        self, products: Sequence[NDArray[np.float64]]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the parameters and states after a damped step."""
        order = self.states.shape[1]
        columns = len(products[0]) - order - 1
        own, shared = slice(columns, columns + order), slice(0, columns)
        total = np.add.reduce([each[shared, shared] for each in products])
        scale = _scale(np.diag(total))
        normal = total + self._damping * np.diag(scale**2)
        right = np.add.reduce([each[shared, -1] for each in products])
        solved = []
        for each in products:
            block = each[own, own] + self._damping * np.diag(_scale(np.diag(each)[own]) ** 2)
            coupled = np.linalg.solve(block, np.column_stack([each[own, shared], each[own, -1]]))
            normal -= each[shared, own] @ coupled[:, :-1]
            right = right - each[shared, own] @ coupled[:, -1]
            solved.append(coupled)
        step = np.linalg.solve(normal / np.outer(scale, scale), right / scale) / scale
        theta = self.theta.copy()
        theta[self.places >= 0] += step[self.places[self.places >= 0]]
        changes = [coupled[:, -1] - coupled[:, :-1] @ step for coupled in solved]
        return theta, self.states + np.array(changes)


def _scale(squares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the norms of derivatives, none much smaller than the median."""
    norms = np.sqrt(np.maximum(squares, 0.0))
    return np.maximum(norms, max(_LEAST_SCALE * float(np.median(norms)), np.finfo(float).tiny ** 0.25))
