"""Projection of responses: what the parameters of a calibrated simulation cannot reproduce."""

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, prior_precision
from islands.diagnosis.calibration.problem import DIFFERENCE_STEP
from islands.diagnosis.calibration.target import Target
from islands.effects.interface.context import Signal


class Projection:
    """Projection of responses onto the orthogonal complement of those that the base's parameters reproduce.

    The parameters act through their linearised, whitened responses. The prior of each parameter is one more
    observation.

    Parameters
    ----------
    base : CalibrationResult
    target : Target
    is_fixed : ndarray, shape (parameters,), optional
        Parameters that reproduce nothing.
    """

    def __init__(
        self, base: CalibrationResult, target: Target, is_fixed: NDArray[np.bool_] | None = None
    ) -> None:
        simulation, values = base.simulation, base.values
        self._target, self._values = target, values.size
        self._sigma = float(np.std(target.residual(base.output))) or 1.0
        inverse_std, nominal = prior_precision(simulation, target.prior_std)
        inverse_std = inverse_std * target.prior_weight**0.5
        columns = []
        self._absorbing: list[int] = []
        points = values + DIFFERENCE_STEP * np.diag(simulation.scales)
        shifted = simulation.simulate_batch(points) if values.size else points
        for index, (scale, moved) in enumerate(zip(simulation.scales, shifted, strict=True)):
            prior = np.zeros(values.size)
            prior[index] = inverse_std[index] * scale
            response = (moved - base.output) / DIFFERENCE_STEP
            # A simulation that is almost unstable diverges for some changes, and has no response to them.
            if not np.isfinite(response).all() or (is_fixed is not None and is_fixed[index]):
                continue
            # The estimation part does not depend on the initial states of recordings in the hold-out part; an
            # orthogonal basis of columns that are zero would contain arbitrary directions.
            if not simulation.is_copy[index] or response[target.estimation_part].any():
                columns.append(self._stack(response, prior))
                self._absorbing.append(index)
        self._scales = simulation.scales
        self._basis: Signal | None = None
        if columns:
            self._basis, self._factor = np.linalg.qr(np.column_stack(columns))
        # The deviation of calibrated values from their prior is part of the residual to be explained.
        self.residual = self._project(self._stack(target.y - base.output, inverse_std * (nominal - values)))
        self._samples = base.noise.effective_samples

    def score_decrease(self, remaining: float) -> float:
        """Return the decrease of minus twice the log-likelihood, given the remaining sum of squares."""
        return self._samples * float(np.log(float(self.residual @ self.residual) / max(remaining, 1e-300)))

    def __call__(self, response: Signal) -> Signal:
        """Project a response, shape (samples,), followed by a zero for the prior of each parameter."""
        return self._project(self._stack(response, np.zeros(self._values)))

    def project_whitened(self, signals: Signal) -> Signal:
        """Project whitened signals over the estimation part, shape (signals, selected); one is a column."""
        return self._project(np.vstack([signals.T / self._sigma, np.zeros((self._values, len(signals)))]))

    def absorb(self, response: Signal) -> Signal:
        """Return the change of the base's parameters that reproduces most of a response, (parameters,)."""
        change = np.zeros(self._values)
        if self._basis is not None:
            product = self._basis.T @ self._stack(response, change)
            found = np.linalg.lstsq(self._factor, product, rcond=None)[0]
            change[self._absorbing] = found * self._scales[self._absorbing]
        return change

    def _project(self, stacked: Signal) -> Signal:
        return stacked if self._basis is None else stacked - self._basis @ (self._basis.T @ stacked)

    def _stack(self, response: Signal, prior: Signal) -> Signal:
        return np.concatenate([self._target.select(response) / self._sigma, prior])
