"""Model with a compiled program, for repeated free runs with different parameters and inputs."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.kernels.interpreter import Program
from islands.kernels.simulate_block import LANES, MANY_LANES, simulate_block
from islands.models.regressor import Regressor
from islands.program.term_pool import link
from islands.simulation.predictors import BOUND, divergence_bound_of_range


@dataclass(frozen=True, slots=True, eq=False)
class LinkedModel:
    """Regressors of a model with their program, which is built once instead of for every free run.

    Attributes
    ----------
    regressors : tuple of Regressor
    warm_up : int
        Number of samples before the first prediction: the largest lag.
    """

    regressors: tuple[Regressor, ...]
    warm_up: int = field(init=False)
    _program: Program = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "warm_up", max(item.maximum_lag for item in self.regressors))
        object.__setattr__(self, "_program", link(self.regressors))

    def __reduce__(self) -> tuple[type["LinkedModel"], tuple[tuple[Regressor, ...]]]:
        # The program contains addresses of this process. Another process builds it again.
        return LinkedModel, (self.regressors,)

    def free_runs(
        self, theta: NDArray[np.float64], u: Sequence[NDArray[np.float64]], start: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Simulate several runs of one recording from its first samples; eight cost little more than one.

        Parameters
        ----------
        theta : ndarray, shape (runs, regressors)
        u : sequence of ndarray, each of shape (inputs, samples)
            Inputs of each run. Runs with equal ones should share the array.
        start : ndarray, shape (runs, warm_up)
            Measured output before the first prediction.

        Returns
        -------
        ndarray, shape (runs, samples)
            Predictions, NaN during the warm-up and after a divergence. Each run is bit-identical to
            `predictors.free_run` on a record whose output is missing after the warm-up.

        Raises
        ------
        RecordError
            The inputs are not longer than the warm-up.
        """
        samples = u[0].shape[1]
        if samples <= self.warm_up:
            raise RecordError(f"the input has {samples} samples and the warm-up takes {self.warm_up}")
        predicted = np.empty((len(theta), samples))
        lanes = LANES if len(theta) <= LANES else MANY_LANES
        for begin in range(0, len(theta), lanes):
            block = slice(begin, begin + lanes)
            predicted[block] = self._run_lanes(theta[block], u[block], start[block])
        predicted[:, : self.warm_up] = np.nan
        # No bound of a run is smaller than `BOUND`.
        if not (np.abs(predicted[:, self.warm_up :]) <= BOUND).all():
            for run, first in zip(predicted, start, strict=True):
                outside = ~(np.abs(run[self.warm_up :]) <= divergence_bound_of_range(first, complete=False))
                if outside.any():
                    run[self.warm_up + int(np.argmax(outside)) :] = np.nan
        return predicted

    def _run_lanes(
        self, theta: NDArray[np.float64], u: Sequence[NDArray[np.float64]], start: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Simulate at most as many runs as a row of the kernel has lanes, shape (runs, samples)."""
        runs, (inputs, samples) = len(theta), u[0].shape
        # Lanes that are left over repeat the runs, and are ignored.
        lanes = [lane % runs for lane in range(LANES if runs <= LANES else MANY_LANES)]
        signals = np.empty((1 + inputs, samples, len(lanes)))
        signals[0, : self.warm_up] = start[lanes].T
        signals[1:] = u[0][:, :, None]
        for lane, run in enumerate(lanes):
            if u[run] is not u[0]:
                signals[1:, :, lane] = u[run]
        ends = np.array([theta.shape[1]], dtype=np.int64)
        rows = signals.reshape(1 + inputs, -1)
        constants = np.repeat(self._program.constants[:, None], len(lanes), axis=1)
        weights = np.ascontiguousarray(theta[lanes].T)
        simulate_block(self._program, weights, constants, ends, self.warm_up, rows)
        predicted: NDArray[np.float64] = signals[0, :, :runs].T
        return predicted
