"""Least squares of the free run of a state space with static units, with free initial states.

Every segment has its initial states, which are eliminated from the normal equations: their block is
small and separate for each segment (Schur complement). Steps are damped (Levenberg 1944, Marquardt 1963).

Under conditions on the parameters, a step is projected onto them in the metric of the normal equations, by
Newton corrections. In the limit of small steps, it is that of the Lagrangian of the linearised conditions.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.estimation.constraints.state_space import NO_CONDITIONS, StateSpaceConditions
from islands.estimation.constraints.static_state import StateSpace
from islands.kernels.state_space import NO_DERIVATIVES, accumulate_products
from islands.models.latent import StateSpaceLayout
from islands.simulation.segment_lanes import SegmentLanes

#: Initial damping, its factors after a failed and a successful step, its limits.
_DAMPING, _INCREASE, _DECREASE, _LEAST_DAMPING, _MAX_DAMPING = 1e-2, 4.0, 0.2, 1e-12, 1e8

#: The steps end after this number of steps with a smaller relative gain.
_PATIENCE, _MIN_GAIN = 4, 1e-5

#: Least norm of the derivatives for a parameter, relative to the median, by which the parameter is scaled.
_LEAST_SCALE = 1e-3


class _Move(NamedTuple):
    """Parameters, initial states, and states at rest of the conditions after a step."""

    theta: NDArray[np.float64]
    states: NDArray[np.float64]
    rests: list[NDArray[np.float64]] | None


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
    segments : SegmentLanes
    states : ndarray, shape (segments, states)
        States at the first rows.
    conditions : StateSpaceConditions
        Conditions on the parameters.
    mean_square : float
        Of the error over all measured outputs; infinite if the parameters do not meet the conditions, which
        the first step then reaches.
    gain : float
        Part by which the last accepted step reduced it.
    """

    theta: NDArray[np.float64]
    places: NDArray[np.int64]
    codes: NDArray[np.int64]
    segments: SegmentLanes
    states: NDArray[np.float64]
    conditions: StateSpaceConditions = NO_CONDITIONS
    mean_square: float = field(init=False)
    gain: float = field(init=False, default=np.inf)
    _damping: float = field(init=False, default=_DAMPING)
    _rests: list[NDArray[np.float64]] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.mean_square = self._measure(self.theta, self.states) if self.meets_conditions else np.inf

    @property
    def system(self) -> StateSpace:
        """State space with the parameters so far."""
        layout = StateSpaceLayout(self.states.shape[1], self.segments[0].u.shape[1], len(self.codes))
        return StateSpace(layout, self.theta, self.codes)

    @property
    def meets_conditions(self) -> bool:
        """Whether the parameters meet the conditions."""
        return self.conditions.are_met(self.system)

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
            moved = self._move(products)
            found = np.inf if moved is None else self._measure(moved.theta, moved.states)
            if moved is not None and found < self.mean_square:
                self.gain = 1.0 - found / self.mean_square
                self.theta, self.states, self._rests = moved
                self.mean_square = found
                self._damping = max(_LEAST_DAMPING, self._damping * _DECREASE)
                return True
            # Corrections that fail are costly, and need a clearly smaller step.
            self._damping *= _INCREASE if moved else _INCREASE**4
        return False

    def _measure(self, theta: NDArray[np.float64], states: NDArray[np.float64]) -> float:
        errors = self.segments.sum_squared_errors(theta, self.codes, states)
        return np.inf if errors is None else float(errors.sum() / max(1, self.segments.counts.sum()))

    def _accumulate(self) -> NDArray[np.float64] | None:
        columns = int(self.places.max()) + 1
        size = columns + self.states.shape[1] + 1
        found = np.empty((len(self.segments), size, size))
        for segment, start, products in zip(self.segments, self.states, found, strict=True):
            rows = accumulate_products(
                *(self.theta, self.places, self.codes, segment.u, start),
                *(segment.y, segment.lower, segment.upper, columns, products, NO_DERIVATIVES),
            )
            if rows < len(segment.y):
                return None
        return found if np.isfinite(found).all() else None

    def _move(self, products: NDArray[np.float64]) -> _Move | None:
        """Return the parameters and states after a damped step; None if it cannot meet the conditions."""
        order = self.states.shape[1]
        columns = products.shape[1] - order - 1
        own, shared = slice(columns, columns + order), slice(0, columns)
        total = products[:, shared, shared].sum(axis=0)
        scale = _scale(np.diagonal(total))
        normal = total + self._damping * np.diag(scale**2)
        blocks = products[:, own, own].copy()
        # The right-hand sides of the states are the columns of the parameters, and the error.
        others = np.concatenate([products[:, own, shared], products[:, own, -1:]], axis=2)
        places = np.arange(order)
        blocks[:, places, places] += self._damping * _scale(blocks[:, places, places]) ** 2
        coupled = np.linalg.solve(blocks, others)
        reduced = (products[:, shared, own] @ coupled).sum(axis=0)
        right = products[:, shared, -1].sum(axis=0) - reduced[:, -1]
        scaled = (normal - reduced[:, :-1]) / np.outer(scale, scale)
        step = np.linalg.solve(scaled, right / scale) / scale
        theta, free, rests = self.theta.copy(), self.places >= 0, self._rests
        theta[free] += step[self.places[free]]
        if self.conditions.statics:

            def invert(columns: NDArray[np.float64]) -> NDArray[np.float64]:
                return np.linalg.solve(scaled, columns / scale[:, None]) / scale[:, None]

            started = self.system.with_theta(theta)
            corrected = self.conditions.correct(started, free, invert, starts=rests)
            if corrected is None:
                return None
            theta, rests = corrected[0].theta, corrected[1].states
            step = (theta - self.theta)[free]
        return _Move(theta, self.states + coupled[:, :, -1] - coupled[:, :, :-1] @ step, rests)


def _scale(squares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the norms of derivatives along the last axis, none much smaller than their median."""
    norms = np.sqrt(np.maximum(squares, 0.0))
    least = _LEAST_SCALE * np.median(norms, axis=-1, keepdims=True)
    return np.maximum(norms, np.maximum(least, np.finfo(float).tiny ** 0.25))
