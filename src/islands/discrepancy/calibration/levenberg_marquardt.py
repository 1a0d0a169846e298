"""Calibration: the values with which a simulation comes closest to a record, by Levenberg and Marquardt."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.discrepancy.calibration.noise_model import NoiseModel, fit_ar_noise, white_noise
from islands.discrepancy.interfaces.effect import Signal
from islands.discrepancy.simulators.extended import ExtendedSimulator

#: Steps at the most, tries of each, and what one has to gain in minus twice the log-likelihood.
STEPS, TRIES, WORTH = 25, 6, 0.02

#: Part of a parameter's scale that a derivative steps.
STEP = 1e-2


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """What a simulation is held against.

    Attributes
    ----------
    y : ndarray, shape (samples,)
        The measured output.
    estimation_part : ndarray of bool, shape (samples,)
        What estimation may see.
    noise : NoiseModel or None
        What residuals are whitened by; None takes them as they are.
    prior_std : mapping
        Relative standard deviations of the core's parameters about their nominal values; who is not named is
        free.
    effective_samples : float or None
        Effective sample size of the estimation part if the residual is model error; None if it is noise,
        white or coloured.
    """

    y: Signal
    estimation_part: NDArray[np.bool_]
    noise: NoiseModel | None
    prior_std: Mapping[str, float]
    effective_samples: float | None = None

    def select(self, signal: Signal) -> Signal:
        """Return the samples of a signal that are seen, whitened."""
        return (signal if self.noise is None else self.noise.whiten(signal))[self.estimation_part]

    def residual(self, simulated: Signal) -> Signal:
        """Return what is left of the samples that are seen, whitened."""
        return self.select(self.y - simulated)


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationResult:
    """A simulation with values, held against a record.

    Attributes
    ----------
    simulation : ExtendedSimulator
    values : ndarray, shape (parameters,)
    output : ndarray, shape (samples,)
        Of the whole record.
    mean_square : float
        Of the residual over the samples that estimation saw.
    noise : NoiseModel
        Of that residual.
    penalty : float
        Squares of the deviations from tolerances.
    """

    simulation: ExtendedSimulator
    values: Signal
    output: Signal
    mean_square: float
    noise: NoiseModel
    penalty: float

    @property
    def score(self) -> float:
        """Minus twice the log-likelihood, the noise's memory counted, effects' values not yet paid for."""
        return self.noise.minus_twice_log_likelihood + self.penalty


def calibrate(
    simulation: ExtendedSimulator, target: Target, start: Signal, steps: int = STEPS
) -> CalibrationResult:
    """Fit a simulation's values from a start."""
    lower, upper = simulation.bounds
    pull, nominal = prior_precision(simulation, target.prior_std)
    scales = simulation.scales
    values = np.clip(start, lower, upper)
    output = simulation.simulate(values)
    residual = target.residual(output)
    cost = _cost(residual, pull * (values - nominal))
    damping = 1e-3
    # What is rounding alone cannot be fitted: a record may be what the simulation has made.
    exact = residual.size * (np.finfo(float).eps * float(np.max(np.abs(target.y)))) ** 2
    for _ in range(steps if values.size and np.isfinite(cost) else 0):
        if float(residual @ residual) <= exact:
            break
        jacobian = _jacobian(simulation, target, values, output)
        weight = residual.size / max(float(residual @ residual), np.finfo(float).tiny)
        hessian = weight * (jacobian.T @ jacobian) + np.diag((pull * scales) ** 2)
        slope = weight * (jacobian.T @ residual) - scales * pull**2 * (values - nominal)
        for _ in range(TRIES):
            curved = hessian + damping * np.diag(np.diag(hessian) + 1e-12)
            moved = np.clip(values + np.linalg.lstsq(curved, slope, rcond=None)[0] * scales, lower, upper)
            output_there = simulation.simulate(moved)
            residual_there = target.residual(output_there)
            cost_there = _cost(residual_there, pull * (moved - nominal))
            if cost_there < cost:
                break
            damping = max(8 * damping, 1e-6)
        else:
            break
        gained = cost - cost_there
        values, output, residual, cost = moved, output_there, residual_there, cost_there
        damping /= 5
        if gained < WORTH:
            break
    return evaluate_fit(simulation, target, values)


def evaluate_fit(simulation: ExtendedSimulator, target: Target, values: Signal) -> CalibrationResult:
    """Hold a simulation against a record with values as they are."""
    output = simulation.simulate(values)
    residual = (target.y - output)[target.estimation_part]
    pull, nominal = prior_precision(simulation, target.prior_std)
    penalty = float(np.sum((pull * (values - nominal)) ** 2))
    mean_square = float(np.mean(residual**2))
    noise = (
        fit_ar_noise(residual)
        if target.effective_samples is None
        else white_noise(mean_square, target.effective_samples)
    )
    return CalibrationResult(simulation, values, output, mean_square, noise, penalty)


def covariance(fit: CalibrationResult, target: Target) -> NDArray[np.float64]:
    """Return the covariance of a fit's values, shape (parameters, parameters): the noise's memory counts."""
    simulation = fit.simulation
    whitened = Target(target.y, target.estimation_part, fit.noise, target.prior_std)
    scales = simulation.scales
    jacobian = _jacobian(simulation, whitened, fit.values, fit.output)
    pull, _ = prior_precision(simulation, target.prior_std)
    worth = fit.noise.effective_samples / np.count_nonzero(target.estimation_part)
    information = worth * (jacobian.T @ jacobian) / fit.noise.variance + np.diag((pull * scales) ** 2)
    inverse: NDArray[np.float64] = np.linalg.pinv(information, hermitian=True) * np.outer(scales, scales)
    return inverse


def prior_precision(simulation: ExtendedSimulator, tolerance: Mapping[str, float]) -> tuple[Signal, Signal]:
    """Return one over each value's standard deviation, 0 where it is free; and where it is pulled to."""
    nominal = simulation.nominal
    pull = np.zeros(nominal.size)
    for place, parameter in enumerate(simulation.simulator.parameters):
        if parameter.name in tolerance:
            pull[place] = 1.0 / (tolerance[parameter.name] * abs(parameter.nominal))
    return pull, nominal


def _jacobian(
    simulation: ExtendedSimulator, target: Target, values: Signal, output: Signal
) -> NDArray[np.float64]:
    """Return how the samples seen change with each scaled value, whitened, shape (seen, parameters)."""
    _, upper = simulation.bounds
    columns = np.empty((int(np.count_nonzero(target.estimation_part)), values.size))
    for place, scale in enumerate(simulation.scales):
        step = STEP if values[place] + STEP * scale <= upper[place] else -STEP
        moved = values.copy()
        moved[place] += step * scale
        columns[:, place] = target.select((simulation.simulate(moved) - output) / step)
    # Where a step explodes nothing is known of that direction.
    return np.nan_to_num(columns, nan=0.0)


def _cost(residual: Signal, pulled: Signal) -> float:
    squares = max(float(residual @ residual), np.finfo(float).tiny)
    if np.isnan(squares):
        return float("inf")
    return residual.size * float(np.log(squares)) + float(pulled @ pulled)
