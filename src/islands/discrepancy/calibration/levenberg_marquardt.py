"""Calibration of a simulation's parameters to a record by the Levenberg-Marquardt method."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from islands.discrepancy.calibration.noise_model import (
    NoiseModel,
    fit_noise,
    fit_whitening,
    white_noise,
)
from islands.discrepancy.interfaces.effect import Signal
from islands.discrepancy.interfaces.segments import find_bounds
from islands.discrepancy.simulators.extended import ExtendedSimulator

#: Maximum number of accepted steps.
MAX_ITERATIONS = 25

#: Maximum number of damping values tried per step.
MAX_DAMPING_TRIALS = 6

#: The iteration ends at a step that decreases minus twice the log-likelihood by less than this.
MIN_DECREASE = 0.02

#: Finite-difference step, as a fraction of the scale of a parameter.
DIFFERENCE_STEP = 1e-2


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Measured output, and the weighting under which a simulation is compared with it.

    Attributes
    ----------
    y : ndarray, shape (samples,)
        The measured output; NaN if it is missing.
    estimation_part : ndarray of bool, shape (samples,)
        Samples used for estimation; none of them is missing.
    noise : NoiseModel or None
        Noise model that whitens residuals; None to leave them unweighted.
    prior_std : mapping
        Relative standard deviations of the simulator's parameters about their nominal values. Parameters that
        are not in it are free.
    effective_samples : float or None
        Effective sample size of the estimation part if the residual is model error; None if it is noise,
        white or coloured.
    segments : tuple of int
        Lengths in samples of the recordings, cut at the gaps of the output; empty for a single recording.
    """

    y: Signal
    estimation_part: NDArray[np.bool_]
    noise: NoiseModel | None
    prior_std: Mapping[str, float]
    effective_samples: float | None = None
    segments: tuple[int, ...] = ()

    @property
    def fitted_segments(self) -> tuple[int, ...]:
        """Number of samples of every segment that are used for estimation, without zeros."""
        counts = (
            int(np.count_nonzero(self.estimation_part[first:last]))
            for first, last in find_bounds(self.segments, self.y.size)
        )
        return tuple(count for count in counts if count)

    @property
    def prior_weight(self) -> float:
        """Weight of a squared prior deviation relative to a squared residual of unit variance.

        A residual of which neighbouring samples are alike has less information than it has samples.
        """
        if self.effective_samples is None:
            return 1.0
        return float(np.count_nonzero(self.estimation_part)) / self.effective_samples

    def select(self, signal: Signal) -> Signal:
        """Return the whitened signal over the estimation part."""
        whitened = signal if self.noise is None else self.noise.whiten(signal, self.segments)
        return whitened[self.estimation_part]

    def residual(self, simulated: Signal) -> Signal:
        """Return the whitened residual over the estimation part."""
        return self.select(self.y - simulated)


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationResult:
    """A simulation with parameter values, and its residual on a record.

    Attributes
    ----------
    simulation : ExtendedSimulator
    values : ndarray, shape (parameters,)
    output : ndarray, shape (samples,)
        Simulated output over the whole record.
    mean_square : float
        Mean square of the residual over the estimation part.
    noise : NoiseModel
        Noise model of that residual.
    penalty : float
        Sum of the squared deviations from the nominal values, in prior standard deviations.
    """

    simulation: ExtendedSimulator
    values: Signal
    output: Signal
    mean_square: float
    noise: NoiseModel
    penalty: float

    @property
    def score(self) -> float:
        """Minus twice the log-likelihood of the noise model plus `penalty`; no BIC penalty of effects."""
        return self.noise.minus_twice_log_likelihood + self.penalty


def calibrate(
    simulation: ExtendedSimulator,
    target: Target,
    start: Signal,
    max_iterations: int = MAX_ITERATIONS,
    is_fixed: NDArray[np.bool_] | None = None,
) -> CalibrationResult:
    """Fit the parameters of a simulation to a record.

    Parameters
    ----------
    simulation : ExtendedSimulator
    target : Target
    start : ndarray, shape (parameters,)
        Starting point. It is clipped to the bounds; if the simulation diverges there, it is not improved.
    max_iterations : int
        Maximum number of accepted steps.
    is_fixed : ndarray of bool, shape (parameters,), optional
        Parameters that keep their values; by default none.
    """
    lower, upper = simulation.bounds
    inverse_std, nominal = prior_precision(simulation, target.prior_std)
    inverse_std = inverse_std * target.prior_weight**0.5
    scales = simulation.scales
    values = np.clip(start, lower, upper)
    output = simulation.simulate(values)
    residual = target.residual(output)
    cost = _compute_cost(residual, inverse_std * (values - nominal))
    damping = 1e-3
    # Residuals at the level of rounding cannot be fitted: the record may be an output of the simulation.
    rounding = residual.size * (np.finfo(float).eps * float(np.nanmax(np.abs(target.y)))) ** 2
    for _ in range(max_iterations if values.size and np.isfinite(cost) else 0):
        if float(residual @ residual) <= rounding:
            break
        jacobian = _compute_jacobian(simulation, target, values, output, is_fixed)
        weight = residual.size / max(float(residual @ residual), np.finfo(float).tiny)
        hessian = weight * (jacobian.T @ jacobian) + np.diag((inverse_std * scales) ** 2)
        slope = weight * (jacobian.T @ residual) - scales * inverse_std**2 * (values - nominal)
        for _ in range(MAX_DAMPING_TRIALS):
            damped = hessian + damping * np.diag(np.diag(hessian) + 1e-12)
            new_values = np.clip(
                values + np.linalg.lstsq(damped, slope, rcond=None)[0] * scales, lower, upper
            )
            new_output = simulation.simulate(new_values)
            new_residual = target.residual(new_output)
            new_cost = _compute_cost(new_residual, inverse_std * (new_values - nominal))
            if new_cost < cost:
                break
            damping = max(8 * damping, 1e-6)
        else:
            break
        decrease = cost - new_cost
        values, output, residual, cost = new_values, new_output, new_residual, new_cost
        damping /= 5
        if decrease < MIN_DECREASE:
            break
    return evaluate_fit(simulation, target, values)


def evaluate_fit(simulation: ExtendedSimulator, target: Target, values: Signal) -> CalibrationResult:
    """Compare a simulation with a record at the given values, without fitting."""
    output = simulation.simulate(values)
    residual = (target.y - output)[target.estimation_part]
    inverse_std, nominal = prior_precision(simulation, target.prior_std)
    penalty = float(np.sum((inverse_std * (values - nominal)) ** 2))
    mean_square = float(np.mean(residual**2))
    noise = (
        fit_noise(residual, segments=target.fitted_segments)
        if target.effective_samples is None
        else white_noise(mean_square, target.effective_samples)
    )
    return CalibrationResult(simulation, values, output, mean_square, noise, penalty)


def whiten_target(target: Target, fit: CalibrationResult) -> Target:
    """Return a target that whitens residuals with a noise model of the residual of a fit."""
    residual = (target.y - fit.output)[target.estimation_part]
    return replace(target, noise=fit_whitening(residual, target.fitted_segments))


def estimate_covariance(fit: CalibrationResult, target: Target) -> NDArray[np.float64]:
    """Estimate the covariance of the fitted values under the noise model of the fit.

    Returns
    -------
    ndarray, shape (parameters, parameters)
    """
    simulation = fit.simulation
    whitened = replace(target, noise=fit.noise)
    scales = simulation.scales
    jacobian = _compute_jacobian(simulation, whitened, fit.values, fit.output)
    inverse_std, _ = prior_precision(simulation, target.prior_std)
    weight = fit.noise.effective_samples / np.count_nonzero(target.estimation_part)
    information = weight * (jacobian.T @ jacobian) / fit.noise.variance + np.diag((inverse_std * scales) ** 2)
    inverse: NDArray[np.float64] = np.linalg.pinv(information, hermitian=True) * np.outer(scales, scales)
    return inverse


def prior_precision(simulation: ExtendedSimulator, tolerance: Mapping[str, float]) -> tuple[Signal, Signal]:
    """Return the prior of a simulation's values.

    Returns
    -------
    ndarray, shape (parameters,)
        Inverse of the prior standard deviation of each value; 0 if the value is free.
    ndarray, shape (parameters,)
        Nominal values, the means of the prior.
    """
    nominal = simulation.nominal
    inverse_std = np.zeros(nominal.size)
    for index, parameter in enumerate(simulation.simulator.parameters):
        if parameter.name in tolerance:
            inverse_std[index] = 1.0 / (tolerance[parameter.name] * abs(parameter.nominal))
    return inverse_std, nominal


def _compute_jacobian(
    simulation: ExtendedSimulator,
    target: Target,
    values: Signal,
    output: Signal,
    is_fixed: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Compute the derivatives of the whitened output with respect to each scaled value; zero if it is fixed.

    Returns
    -------
    ndarray, shape (estimation samples, parameters)
    """
    _, upper = simulation.bounds
    columns = np.zeros((int(np.count_nonzero(target.estimation_part)), values.size))
    free = np.arange(values.size) if is_fixed is None else np.flatnonzero(~is_fixed)
    scales = simulation.scales[free]
    steps = np.where(
        values[free] + DIFFERENCE_STEP * scales <= upper[free], DIFFERENCE_STEP, -DIFFERENCE_STEP
    )
    points = np.tile(values, (free.size, 1))
    points[np.arange(free.size), free] += steps * scales
    shifted = simulation.simulate_batch(points) if free.size else points
    for index, step, moved in zip(free, steps, shifted, strict=True):
        columns[:, index] = target.select((moved - output) / step)
    # A simulation that diverges at the shifted value gives no information about that direction.
    return np.nan_to_num(columns, nan=0.0)


def _compute_cost(residual: Signal, prior_residual: Signal) -> float:
    squares = max(float(residual @ residual), np.finfo(float).tiny)
    if np.isnan(squares):
        return float("inf")
    return residual.size * float(np.log(squares)) + float(prior_residual @ prior_residual)
