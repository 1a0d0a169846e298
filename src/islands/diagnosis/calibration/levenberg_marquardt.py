"""Calibration of a simulation's parameters to a record by the Levenberg-Marquardt method."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.calibration.problem import (
    CalibrationProblem,
    FittedPoint,
    Simulated,
    simulate_together,
)
from islands.diagnosis.calibration.target import Target
from islands.effects.interface.context import Signal
from islands.records.noise_model import (
    NoiseModel,
    fit_noise,
    fit_whitening,
    white_noise,
)
from islands.simulators.extended import ExtendedSimulator

#: Maximum number of accepted steps.
MAX_ITERATIONS = 25

#: Maximum number of damping values tried per step.
MAX_DAMPING_TRIALS = 6

#: The iteration ends at a step that decreases minus twice the log-likelihood by less than this.
MIN_DECREASE = 0.02

#: Number of samples from which simulations that may not be needed are computed in the same call as others.
#: In shorter ones, the preparation of a simulation costs as much as what a common call saves, unless it fits
#: states: that takes thirteen simulations, once for a point and its derivatives.
MIN_BATCHED_SAMPLES = 800

#: Least information on a combination of values, relative to that on each of them alone, with which it counts
#: as determined: below it, intervals are hundreds of times as wide as with one of the values known.
MIN_INFORMATION = 1e-5

#: First and least damping, factor between the damping values of a step, and decrease after a step.
FIRST_DAMPING, MIN_DAMPING, DAMPING_FACTOR, DAMPING_DECREASE = 1e-3, 1e-9, 8.0, 5.0


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
    (point,) = minimise(simulation, target, [start], max_iterations, is_fixed=is_fixed)
    return compare_output(simulation, target, point.values, point.output)


def minimise(
    simulation: ExtendedSimulator,
    target: Target,
    starts: Sequence[Signal],
    max_iterations: int = MAX_ITERATIONS,
    min_decrease: float = MIN_DECREASE,
    is_fixed: NDArray[np.bool_] | None = None,
) -> list[FittedPoint]:
    """Fit the parameters from each start as `calibrate` does, without a noise model of the residual.

    Parameters
    ----------
    starts : sequence of ndarray, each of shape (parameters,)
        The fits share the calls of the simulation, and do not depend on one another.
    min_decrease : float
        The iteration ends at a step that decreases the cost by less than this, or if the derivatives promise
        a tenth of it.
    """
    problem = _make_problem(simulation, target, is_fixed)
    is_costly = simulation.fits_states or target.y.size >= MIN_BATCHED_SAMPLES
    is_batch = simulation.is_batch and is_costly
    # Residuals at the level of rounding cannot be fitted: the record may be an output of the simulation.
    error = np.finfo(float).eps * float(np.nanmax(np.abs(target.y)))
    rounding = np.count_nonzero(target.estimation_part) * error**2
    return simulate_together(
        simulation,
        [_minimise(problem, start, max_iterations, min_decrease, rounding, is_batch) for start in starts],
    )


def _minimise(
    problem: CalibrationProblem,
    start: Signal,
    max_iterations: int,
    min_decrease: float,
    min_squares: float,
    is_batch: bool,
) -> Simulated[FittedPoint]:
    """Minimise the cost from one start.

    Parameters
    ----------
    min_squares : float
        The iteration ends at a smaller sum of squares.
    is_batch : bool
        Whether to simulate what may not be needed in the same call as what is.
    """
    point = yield from problem.evaluate(start, with_jacobian=is_batch)
    damping, is_rejected = FIRST_DAMPING, False
    for remaining in reversed(range(max_iterations if start.size and np.isfinite(point.cost) else 0)):
        if float(point.residual @ point.residual) <= min_squares:
            break
        point = yield from problem.linearise(point)
        dampings: Signal = damping * DAMPING_FACTOR ** np.arange(MAX_DAMPING_TRIALS, dtype=np.float64)
        steps, predicted = problem.find_steps(point, dampings)
        if predicted.max() < 0.1 * min_decrease:
            break
        if is_rejected and is_batch:
            trials = yield from problem.evaluate_all(steps)
        else:
            # The derivatives at the next point are simulated in the same call, unless it is the last one.
            with_jacobian = is_batch and remaining > 0 and bool(predicted[0] > min_decrease)
            trials = [(yield from problem.evaluate(steps[0], with_jacobian))]
            if not trials[0].cost < point.cost:
                trials += yield from _try_further(problem, steps[1:], point.cost, is_batch)
        place = next((index for index, trial in enumerate(trials) if trial.cost < point.cost), None)
        if place is None:
            break
        decrease = point.cost - trials[place].cost
        point, is_rejected = trials[place], place > 0
        damping = max(float(dampings[place]) / DAMPING_DECREASE, MIN_DAMPING)
        if decrease < min_decrease:
            break
    return point


def _try_further(
    problem: CalibrationProblem, steps: Signal, cost: float, is_batch: bool
) -> Simulated[list[FittedPoint]]:
    """Evaluate several steps: all at once, or one by one until one of them decreases the cost."""
    if is_batch:
        return (yield from problem.evaluate_all(steps))
    trials: list[FittedPoint] = []
    for values in steps:
        trials.append((yield from problem.evaluate(values)))
        if trials[-1].cost < cost:
            break
    return trials


def _make_problem(
    simulation: ExtendedSimulator, target: Target, is_fixed: NDArray[np.bool_] | None = None
) -> CalibrationProblem:
    inverse_std, nominal = prior_precision(simulation, target.prior_std)
    return CalibrationProblem(simulation, target, inverse_std * target.prior_weight**0.5, nominal, is_fixed)


def evaluate_fit(simulation: ExtendedSimulator, target: Target, values: Signal) -> CalibrationResult:
    """Simulate at the given values and compare the output with a record, without fitting."""
    return compare_output(simulation, target, values, simulation.simulate(values))


def compare_output(
    simulation: ExtendedSimulator, target: Target, values: Signal, output: Signal
) -> CalibrationResult:
    """Compare the output of a simulation at the given values with a record."""
    residual = (target.y - output)[target.estimation_part]
    inverse_std, nominal = prior_precision(simulation, target.prior_std)
    penalty = float(np.sum((inverse_std * (values - nominal)) ** 2))
    mean_square = float(np.mean(residual**2))
    noise = (
        fit_noise(residual, segments=target.fitted_segments)
        if target.effective_samples is None
        else white_noise(mean_square, target.effective_samples)
    )
    # The innovations of a sum contain those of its white part, here the rounding errors of the output.
    noise = replace(noise, variance=max(noise.variance, target.resolution**2 / 12.0))
    return CalibrationResult(simulation, values, output, mean_square, noise, penalty)


def whiten_target(target: Target, fit: CalibrationResult) -> Target:
    """Return a target that whitens residuals with a noise model of the residual of a fit."""
    residual = (target.y - fit.output)[target.estimation_part]
    return replace(target, noise=fit_whitening(residual, target.fitted_segments))


def estimate_covariance(fit: CalibrationResult, target: Target) -> NDArray[np.float64]:
    """Estimate the covariance of the fitted values under the noise model of the fit.

    If a change of several values together has almost no response, as a gain of the plant that a term at the
    output makes up for, the first of these values is held: it has the variance 0.

    Returns
    -------
    ndarray, shape (parameters, parameters)
    """
    simulation = fit.simulation
    whitened = replace(target, noise=fit.noise)
    scales = simulation.scales
    problem = _make_problem(simulation, whitened)
    (point,) = simulate_together(simulation, [problem.evaluate(fit.values, with_jacobian=True)])
    jacobian = point.jacobian
    assert jacobian is not None
    inverse_std, _ = prior_precision(simulation, target.prior_std)
    weight = fit.noise.effective_samples / np.count_nonzero(target.estimation_part)
    information = weight * (jacobian.T @ jacobian) / fit.noise.variance + np.diag((inverse_std * scales) ** 2)
    return _invert_information(information) * np.outer(scales, scales)


def _invert_information(information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Invert an information matrix without the values that others make up for."""
    size = np.sqrt(np.diag(information))
    free = list(np.flatnonzero(size > 0.0))
    while free:
        relative = information[np.ix_(free, free)] / np.outer(size[free], size[free])
        lengths, directions = np.linalg.eigh(relative)
        if lengths[0] >= MIN_INFORMATION:
            break
        parts = np.abs(directions[:, 0])
        # Values of the simulation come before those of what extends it.
        del free[int(np.argmax(parts >= 0.5 * parts.max()))]
    inverse = np.zeros_like(information)
    inverse[np.ix_(free, free)] = np.linalg.pinv(information[np.ix_(free, free)], hermitian=True)
    return inverse


def estimate_deviations(fit: CalibrationResult, target: Target) -> Signal:
    """Estimate the standard deviations of the fitted values, shape (parameters,)."""
    deviations: Signal = np.sqrt(np.maximum(np.diag(estimate_covariance(fit, target)), 0.0))
    return deviations


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
