"""Least-squares problem of a calibration: costs at values of the parameters, derivatives, and damped steps.

Simulations of one call share the arithmetic of the kernels, so that sixteen cost little more than one. The
derivatives at a point are therefore simulated in the same call as the point itself, and several fits of one
simulation share their calls: a function that needs outputs is a generator, which yields the points and
receives the outputs.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from islands.effects.interface.context import Signal
from islands.simulators.extended import ExtendedSimulator

#: Finite-difference step, as a fraction of the scale of a parameter.
DIFFERENCE_STEP = 1e-2


T = TypeVar("T")


class Points(NamedTuple):
    """Points to be simulated.

    Attributes
    ----------
    values : ndarray, shape (points, parameters)
    are_near_last : bool
        Whether all points are small changes of the last one, for derivatives.
    """

    values: Signal
    are_near_last: bool = False


#: Computation that yields points and receives their outputs, shape (points, samples).
Simulated: TypeAlias = Generator[Points, Signal, T]


class Weighting(Protocol):
    """Measured output and the weights of its samples."""

    def select(self, signal: Signal) -> Signal:
        """Return the weighted samples of a signal that are fitted; linear."""

    def residual(self, simulated: Signal) -> Signal:
        """Return the weighted residual of the samples that are fitted."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedPoint:
    """Values of the parameters, with what the simulation gives there.

    Attributes
    ----------
    values : ndarray, shape (parameters,)
    output : ndarray, shape (samples,)
    residual : ndarray, shape (fitted samples,)
    cost : float
        Minus twice the log-likelihood of white noise with unknown variance, plus the squared deviations from
        the prior; infinite if the simulation diverges.
    jacobian : ndarray, shape (fitted samples, parameters), or None
        Derivatives of the weighted output with respect to the scaled values; None if they were not asked for.
    """

    values: Signal
    output: Signal
    residual: Signal
    cost: float
    jacobian: NDArray[np.float64] | None = None


class CalibrationProblem:
    """Sum of squares of a weighted residual and of deviations from a prior, in scaled values.

    Parameters
    ----------
    simulation : ExtendedSimulator
    weighting : Weighting
    inverse_std, nominal : ndarray, shape (parameters,)
        Inverse standard deviations of the prior, 0 for free values, and its means.
    is_fixed : ndarray of bool, shape (parameters,), optional
        Parameters that keep their values; by default none.
    """

    def __init__(
        self,
        simulation: ExtendedSimulator,
        weighting: Weighting,
        inverse_std: Signal,
        nominal: Signal,
        is_fixed: NDArray[np.bool_] | None = None,
    ) -> None:
        self._simulation, self._weighting = simulation, weighting
        self._inverse_std, self._nominal = inverse_std, nominal
        self._scales = simulation.scales
        count = nominal.size
        self._free = np.arange(count) if is_fixed is None else np.flatnonzero(~is_fixed)

    def evaluate(self, values: Signal, with_jacobian: bool = False) -> Simulated[FittedPoint]:
        """Simulate at the nearest values within the bounds, and around them for the derivatives."""
        values = self._simulation.project(values[None])[0]
        if not with_jacobian:
            (output,) = yield Points(values[None])
            return self._compare(values, output)
        points, steps = self._list_differences(values)
        # The last simulations are cached.
        *shifted, output = yield Points(np.vstack([points, values]), are_near_last=True)
        return self._differentiate(self._compare(values, output), shifted, steps)

    def evaluate_all(self, points: Signal) -> Simulated[list[FittedPoint]]:
        """Simulate at several points, shape (points, parameters), within the bounds."""
        outputs = yield Points(points)
        return [self._compare(values, output) for values, output in zip(points, outputs, strict=True)]

    def linearise(self, point: FittedPoint) -> Simulated[FittedPoint]:
        """Return a point with its derivatives."""
        if point.jacobian is not None:
            return point
        points, steps = self._list_differences(point.values)
        *shifted, _ = yield Points(np.vstack([points, point.values]), are_near_last=True)
        return self._differentiate(point, shifted, steps)

    def _list_differences(self, values: Signal) -> tuple[Signal, Signal]:
        """Return the points for the derivatives, and the step of each as a fraction of the scale."""
        free, scales = self._free, self._scales[self._free]
        changes = np.zeros((free.size, values.size))
        changes[np.arange(free.size), free] = DIFFERENCE_STEP * scales
        is_inside = (self._simulation.project(values + changes) == values + changes).all(axis=1)
        steps = np.where(is_inside, DIFFERENCE_STEP, -DIFFERENCE_STEP)
        points = values + np.where(is_inside[:, None], changes, -changes)
        return points, steps

    def _differentiate(self, point: FittedPoint, shifted: list[Signal], steps: Signal) -> FittedPoint:
        columns = np.zeros((point.residual.size, point.values.size))
        for index, step, output in zip(self._free, steps, shifted, strict=True):
            columns[:, index] = self._weighting.select((output - point.output) / step)
        # A simulation that diverges at the shifted value gives no information about that direction.
        if not np.isfinite(columns).all():
            columns = np.nan_to_num(columns, nan=0.0)
        return FittedPoint(point.values, point.output, point.residual, point.cost, columns)

    def _compare(self, values: Signal, output: Signal) -> FittedPoint:
        residual = self._weighting.residual(output)
        prior = self._inverse_std * (values - self._nominal)
        squares = max(float(residual @ residual), np.finfo(float).tiny)
        cost = residual.size * float(np.log(squares)) + float(prior @ prior)
        return FittedPoint(values, output, residual, float("inf") if np.isnan(squares) else cost)

    def find_steps(self, point: FittedPoint, dampings: Signal) -> tuple[Signal, Signal]:
        """Return the values after damped steps, and the decreases of the cost that the derivatives promise.

        The damping of each direction is relative to its curvature (Marquardt, 1963).

        Parameters
        ----------
        point : FittedPoint
            Point with its derivatives.
        dampings : ndarray, shape (steps,)

        Returns
        -------
        ndarray, shape (steps, parameters)
            Within the bounds.
        ndarray, shape (steps,)
        """
        jacobian, residual = point.jacobian, point.residual
        assert jacobian is not None
        weight = residual.size / max(float(residual @ residual), np.finfo(float).tiny)
        prior = self._inverse_std * self._scales
        hessian = weight * (jacobian.T @ jacobian) + np.diag(prior**2)
        slope = weight * (jacobian.T @ residual) - prior * self._inverse_std * (point.values - self._nominal)
        sizes = np.sqrt(np.diag(hessian) + 1e-12)
        # One decomposition serves all dampings.
        curvatures, directions = np.linalg.eigh(hessian / np.outer(sizes, sizes))
        damped = np.maximum(curvatures, 0.0) + dampings[:, None]
        is_kept = damped > np.finfo(float).eps * curvatures.size * damped.max(axis=1, keepdims=True)
        along = np.where(is_kept, directions.T @ (slope / sizes) / damped, 0.0)
        moved = point.values + (along @ directions.T) / sizes * self._scales
        values = self._simulation.project(moved)
        changes = (values - point.values) / self._scales
        predicted = 2.0 * changes @ slope - np.einsum("ij,jk,ik->i", changes, hessian, changes)
        return values, predicted


def simulate_together(simulation: ExtendedSimulator, computations: Sequence[Simulated[T]]) -> list[T]:
    """Run computations that need outputs of a simulation, with one call for the points of all of them.

    Returns
    -------
    list
        Result of each computation. It does not depend on the others.
    """
    results: dict[int, T] = {}
    asked: dict[int, Points] = {}

    def resume(index: int, outputs: Signal | None) -> None:
        asked.pop(index, None)
        try:
            # A generator is started by None.
            asked[index] = computations[index].send(outputs)  # type: ignore[arg-type]
        except StopIteration as end:
            results[index] = end.value

    for index in range(len(computations)):
        resume(index, None)
    while asked:
        indices, points = list(asked), list(asked.values())
        ends = np.cumsum([len(each.values) for each in points])
        near = np.arange(ends[-1])
        for each, end in zip(points, ends, strict=True):
            if each.are_near_last:
                near[end - len(each.values) : end] = end - 1
        outputs = simulation.simulate_batch(np.vstack([each.values for each in points]), near)
        for index, part in zip(indices, np.split(outputs, ends[:-1]), strict=True):
            resume(index, part)
    return [results[index] for index in range(len(computations))]
