"""Feedback within a sample: the input contains the noise that the output has in the same row of the record.

A controller that computes u(k) from y(k) correlates them. A response of the simulation at once is then fitted
to the noise, and an effect, a term or a map of the residual that reads u(k) takes the noise for a
discrepancy. If the plant does not respond at once and the noise is white, the simulation without a direct
term is consistent (Ljung, System Identification, 2nd ed., section 13.4). With a direct term of the plant
it is not, so that feedback has to be distinguished from one: a direct term multiplies every change of the
input by the same factor, while the residual does not respond to changes of the setpoint, which are larger
than the noise. Small and large changes of the input together give the direct term without the part of the
noise. Where all changes of the input are alike, the record does not decide, and nothing is held.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.gross_errors.closed_loop import (
    MIN_DISTANCE_WITHIN_A_SAMPLE,
    acts_at_once,
    measure_feedback,
    whiten,
)
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect, Site
from islands.simulators.linear import LinearSimulator
from islands.simulators.output_equation import OutputEquation, add_output_equation

#: Fraction of the samples with the largest changes of the input. In 24 simulated loops with a direct term and
#: 24 without, this one separates them best.
LARGE_CHANGES = 0.02

#: Difference of the responses to small and to large changes of the input, in standard deviations, from which
#: no direct term explains both.
MIN_CONTRADICTION = 4.0

#: Direct term in standard deviations from which the plant responds at once. In these loops it is at most 2.1
#: without one, and at least 3.7 with one that is as large as the next coefficient.
MAX_DIRECT_TERM = 3.0

#: Largest increase of the mean square without a direct term. In simulated loops it is at most 0.08; in
#: records without feedback of plants whose direct term is half of the next coefficient, it is 0.15 to 1.7.
MAX_LOSS = 0.2


def hold_direct_term(base: CalibrationResult, target: Target) -> CalibrationResult | None:
    """Return the fit with which the input of a record feeds back within a sample; None if it does not.

    The direct term of a linear simulation is held at zero, unless it has a tolerance. A simulation of another
    kind that responds at once is left as it is.

    Parameters
    ----------
    base : CalibrationResult
        The simulation without effects.
    """
    if target.is_matched(base.output):
        return None
    linear = _find_linear(base)
    if linear is not None and not linear.delay and "b0" not in target.prior_std:
        # A direct term that is fitted to the noise may be small compared with the whole response.
        fit = _calibrate_without_direct_term(base, linear, target)
        is_possible = fit.mean_square < (1.0 + MAX_LOSS) * base.mean_square
    else:
        fit, is_possible = base, not acts_at_once(base)
    return fit if is_possible and feeds_back_at_once(fit, target) else None


def feeds_back_at_once(fit: CalibrationResult, target: Target) -> bool:
    """Return whether the input contains the residual of the same sample, which no direct term explains.

    Parameters
    ----------
    fit : CalibrationResult
        A simulation that does not respond at once.
    """
    u, residual = fit.simulation.context.u[: target.fitted], (target.y - fit.output)[: target.fitted]
    residual = np.where(np.isnan(residual), np.nanmean(residual), residual)
    if measure_feedback(u, residual, 0, MIN_DISTANCE_WITHIN_A_SAMPLE) is None:
        return False
    errors, inputs = whiten(residual), whiten(u)
    is_large = np.abs(inputs) > np.quantile(np.abs(inputs), 1.0 - LARGE_CHANGES)
    (large, of_large), (small, of_small) = (
        _fit_slope(errors[part], inputs[part]) for part in (is_large, ~is_large)
    )
    # The covariance with the noise is that of all changes: slope = direct term + covariance / mean square.
    weights = np.array([np.mean(inputs[part] ** 2) for part in (is_large, ~is_large)]) * (1.0, -1.0)
    direct, of_direct = weights @ (large, small), weights**2 @ (of_large, of_small)
    is_contradicted = abs(large - small) > MIN_CONTRADICTION * float(np.sqrt(of_large + of_small))
    return is_contradicted and bool(abs(direct) < MAX_DIRECT_TERM * np.sqrt(of_direct))


def list_late_effects(effects: Sequence[Effect], base: CalibrationResult) -> list[Effect]:
    """Return the effects that do not add a function of the input to the output of the same sample."""
    is_at_once = not base.simulation.context.force_coordinate.is_output
    return [effect for effect in effects if not (is_at_once and effect.site == Site.FORCE)]


def _find_linear(base: CalibrationResult) -> LinearSimulator | None:
    """Return the linear simulation of a fit that is more than a gain; None if it is another one."""
    equation = base.simulation.simulator
    linear = equation.simulator if isinstance(equation, OutputEquation) else None
    return linear if isinstance(linear, LinearSimulator) and linear.denominator.size else None


def _calibrate_without_direct_term(
    base: CalibrationResult, linear: LinearSimulator, target: Target
) -> CalibrationResult:
    """Return the fit of a linear simulation without a direct term."""
    held = replace(linear, has_direct_term=False)

    def fit(simulator: LinearSimulator) -> CalibrationResult:
        with_equation = add_output_equation(simulator, base.simulation.context)
        simulation = replace(base.simulation, simulator=with_equation)
        return calibrate(simulation, target, simulation.nominal)

    found = fit(held)
    if linear.numerator[0] == 0.0:
        return found
    numerator, denominator, level, _ = held.split_values(found.values)
    # Coefficients that were estimated together with the direct term are none of a simulation without it.
    return fit(replace(held, numerator=numerator, denominator=denominator, level=level))


def _fit_slope(errors: Signal, inputs: Signal) -> tuple[float, float]:
    """Return the slope of a regression without a constant, and its variance."""
    energy = float(inputs @ inputs) or np.finfo(float).tiny
    slope = float(errors @ inputs) / energy
    return slope, float(np.mean((errors - slope * inputs) ** 2)) / energy
