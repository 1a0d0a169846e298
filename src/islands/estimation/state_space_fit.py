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
from islands.estimation.constraints.static_state import StateSpaceParameters
from islands.kernels.damped_step import solve_damped, solve_own
from islands.kernels.dependent_parameters import extend_products, find_dependent
from islands.kernels.state_space_products import NO_DERIVATIVES, accumulate_products
from islands.models.latent import StateSpaceLayout
from islands.simulation.segment_lanes import SegmentLanes

#: Initial damping, its factors after a failed and a successful step, its limits.
_DAMPING, _INCREASE, _DECREASE, _LEAST_DAMPING, _MAX_DAMPING = 1e-2, 4.0, 0.2, 1e-12, 1e8

#: The steps end after this number of steps with a smaller relative gain.
_PATIENCE, _MIN_GAIN = 4, 1e-5

#: Least norm of the derivatives for a parameter, relative to the median, by which the parameter is scaled.
_LEAST_SCALE = 1e-3


class _Equations(NamedTuple):
    """Normal equations of all segments; see `solve_damped`."""

    own_rows: NDArray[np.float64]
    total: NDArray[np.float64]
    scale: NDArray[np.float64]
    own_scale: NDArray[np.float64]
    #: Place of each parameter in the equations, -1 of a fixed one. Dependent ones are last.
    order: NDArray[np.int64]


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
    def system(self) -> StateSpaceParameters:
        """State space with the parameters so far."""
        layout = StateSpaceLayout(self.states.shape[1], self.segments[0].u.shape[1], len(self.codes))
        return StateSpaceParameters(layout, self.theta, self.codes)

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
        equations = self._accumulate()
        if equations is None:
            return False
        while self._damping <= _MAX_DAMPING:
            moved = self._move(equations)
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

    def _accumulate(self) -> _Equations | None:
        traces = self.segments.trace(self.theta, self.codes, self.states)
        if traces is None:
            return None
        columns, (segments, own), units = int(self.places.max()) + 1, self.states.shape, len(self.codes)
        directions = np.empty((own * (own + 1), columns + self.states.size))
        dependent, inputs = np.empty(len(directions), np.int64), self.segments[0].u.shape[1]
        sizes = inputs, units, self.states, columns
        count = find_dependent(self.theta, self.places, *sizes, directions, dependent)
        kept = np.delete(np.arange(columns), dependent[:count])
        order = np.full(columns + 1, -1)
        order[[*kept, *dependent[:count]]] = range(columns)
        order = order[self.places]
        found = np.empty((segments, len(kept) + own + 1, len(kept) + own + 1))
        places = np.where(order < len(kept), order, -1)
        for lane, (segment, products) in enumerate(zip(self.segments, found, strict=True)):
            accumulate_products(
                *(self.theta, places, units, traces, lane, segment.u),
                *(segment.y, segment.lower, segment.upper, len(kept), products, NO_DERIVATIVES),
            )
        if not np.isfinite(found).all():
            return None
        own_rows, total = np.empty((segments, own, columns + own + 1)), np.empty((columns, columns + 1))
        combinations = directions[:count, [*kept, *range(columns, directions.shape[1])]]
        extend_products(found, combinations, own_rows, total)
        own_squares = np.diagonal(found, axis1=1, axis2=2)[:, len(kept) : -1]
        return _Equations(own_rows, total, _scale(np.diagonal(total)), _scale(own_squares), order)

    def _move(self, equations: _Equations) -> _Move | None:
        """Return the parameters and states after a damped step.

        None if it cannot meet the conditions, or the damping is too small for the rounding of the equations.
        """
        own_rows, total, scale, own_scale, order = equations
        blocks, step = np.empty((*own_scale.shape, own_scale.shape[1])), np.empty(len(scale))
        factors = np.empty((own_scale.size + len(scale), len(scale) + 1))
        if not solve_damped(own_rows, total, scale, own_scale, self._damping, blocks, factors, step):
            return None
        theta, free, rests = self.theta.copy(), self.places >= 0, self._rests
        at = order[free]
        theta[free] += (step / scale)[at]
        if self.conditions.statics:
            # Values below the diagonal have no meaning.
            root = np.triu(factors[own_scale.size :, :-1])[:, at]

            def invert(columns: NDArray[np.float64]) -> NDArray[np.float64]:
                scales = scale[at, None]
                half = np.linalg.solve(root.T, columns / scales)
                return np.linalg.solve(root, half) / scales

            started = self.system.with_theta(theta)
            corrected = self.conditions.correct(started, free, invert, starts=rests)
            if corrected is None:
                return None
            theta, rests = corrected[0].theta, corrected[1].states
            step[at] = (theta - self.theta)[free] * scale[at]
        changes = np.empty(own_scale.shape)
        solve_own(blocks, factors, step, changes)
        return _Move(theta, self.states + changes, rests)


def _scale(squares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the norms of derivatives along the last axis, none much smaller than their median."""
    norms = np.sqrt(np.maximum(squares, 0.0))
    middle = norms.shape[-1] // 2
    least = _LEAST_SCALE * np.sort(norms, axis=-1)[..., middle : middle + 1]
    return np.maximum(norms, np.maximum(least, np.finfo(float).tiny ** 0.25))
