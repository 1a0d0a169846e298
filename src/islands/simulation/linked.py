"""Model with a compiled program, for repeated free runs with different parameters and inputs."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.kernels.interpreter import Program
from islands.kernels.simulation.simulate import WIDTHS, Layout, simulate
from islands.model.regressor import Regressor
from islands.program.term_pool import link
from islands.simulation.predictors import divergence_bound_of_range

#: A single run uses the first lane of the narrowest row.
_WIDTH = WIDTHS[0]


@dataclass(frozen=True, slots=True, eq=False)
class LinkedModel:
    """Regressors of a model with their program, which is built once instead of for every `free_run`.

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

    def free_run(
        self, theta: NDArray[np.float64], u: NDArray[np.float64], start: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Simulate one recording from its first samples.

        Parameters
        ----------
        theta : ndarray, shape (regressors,)
        u : ndarray, shape (samples, inputs)
        start : ndarray, shape (warm_up,)
            Measured output before the first prediction.

        Returns
        -------
        ndarray, shape (samples,)
            Predictions, NaN during the warm-up and after a divergence. Bit-identical to
            `predictors.free_run` on a record whose output is missing after the warm-up.

        Raises
        ------
        RecordError
            The input is not longer than the warm-up.
        """
        samples, inputs = u.shape
        if samples <= self.warm_up:
            raise RecordError(f"the input has {samples} samples and the warm-up takes {self.warm_up}")
        # As in the one-step-ahead layout, each row starts one sample after the previous one. Only the first
        # lane is used; the others run on later samples and are ignored.
        signals = np.zeros((1 + inputs, samples + _WIDTH))
        signals[0, : self.warm_up] = start
        signals[1:, :samples] = u.T
        single, length = np.ones(1, np.int64), np.array([samples - self.warm_up])
        cut = Layout(signals, 0 * single, single, 1, self.warm_up * single, length, _WIDTH, self.warm_up, 0.0)
        bound = divergence_bound_of_range(start, complete=False)
        diverged, predicted = np.empty(1, np.int64), np.full(samples, np.nan)
        simulate(self._program, theta, cut, bound, np.inf, True, np.empty(1), diverged, predicted)
        if diverged[0] >= 0:
            predicted[self.warm_up + diverged[0] :] = np.nan
        return predicted
