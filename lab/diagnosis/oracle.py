"""Oracle: a fit that knows the names of the injected faults. It bounds the achievable improvement."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.preparation import select_effects
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.hypothesis import Hypothesis, remove_each
from islands.diagnosis.inference.screening import transfer_parameters
from islands.diagnosis.result import Diagnosis
from islands.effects import catalogue
from islands.effects.catalogue import catalogue_order
from islands.effects.interface.effect import Effect

#: Number of starting points of each effect that are fitted, the most promising ones.
_STARTS = 3

#: Smallest relative improvement of the oracle for which the ratio is defined.
_MIN_IMPROVEMENT = 0.01


@dataclass(frozen=True, slots=True)
class OracleScore:
    """Comparison of a diagnosis with the oracle.

    Attributes
    ----------
    gain_share : float or None
        Improvement of the diagnosis on the held-out samples relative to that of the oracle. None if the
        oracle improves the fit by less than 1 %, or if a fault has no effect in the catalogue.
    least_gain : float or None
        Least increase of the oracle's cost without one of several faults, in minus twice the log-likelihood
        with the BIC penalty. None for a single fault, or if the oracle leaves coloured noise: then its fit
        may be incomplete.
    """

    gain_share: float | None = None
    least_gain: float | None = None


def score_oracle(found: Diagnosis, names: Sequence[str], tolerance: Mapping[str, float]) -> OracleScore:
    """Compare a diagnosis with the oracle.

    Parameters
    ----------
    found : Diagnosis
    names : sequence of str
        Names of the injected faults.
    tolerance : mapping
        Tolerances of the parameters, as given to the diagnosis.
    """
    record, fitted = found.record, found.estimation_samples
    estimation_part = np.arange(record.samples) < fitted
    target = Target(record.y, estimation_part, None, tolerance, segments=record.segments, fitted=fitted)
    simulation = found.base.simulation
    effects = select_effects(simulation.simulator, simulation.context, tolerance)
    oracle = found.base
    # Correcting the form of the simulator itself is not an improvement by a cause: diagnosis and oracle are
    # both compared with the simulator of corrected form.
    for form in (effect for effect in effects if effect.name == catalogue.CORE_SHAPE):
        oracle = _fit_with_effect(oracle, form, target)
    before = _rmse(found, oracle)
    for name in names:
        variants = [effect for effect in effects if effect.name.partition(":")[0] == name]
        if not variants:
            return OracleScore()
        oracle = min(
            (_fit_with_effect(oracle, effect, target) for effect in variants), key=lambda fit: fit.mean_square
        )
    if oracle.noise.order:
        oracle = calibrate(
            oracle.simulation,
            replace(target, noise=oracle.noise),
            oracle.values,
        )
    after, best = _rmse(found, found.best), _rmse(found, oracle)
    has_gain = best < (1.0 - _MIN_IMPROVEMENT) * before
    return OracleScore(
        (before - after) / (before - best) if has_gain else None,
        _compute_least_gain(oracle, target, len(names)) if len(names) > 1 else None,
    )


def _compute_least_gain(oracle: CalibrationResult, target: Target, faults: int) -> float | None:
    """Return the least gain of one of several faults next to the others; see `OracleScore`."""
    if oracle.noise.order:
        return None
    effects = tuple(each for each in oracle.simulation.effects if each.name != catalogue.CORE_SHAPE)
    if len(effects) < faults:
        return 0.0
    complete = Hypothesis(oracle, oracle.score, effects)
    return min(each.cost for each in remove_each(complete, effects, target)) - complete.cost


def _rmse(found: Diagnosis, fit: CalibrationResult) -> float:
    """Return the RMSE over the held-out samples."""
    return float(np.sqrt(np.mean((found.record.y - fit.output)[found.estimation_samples :] ** 2)))


def _fit_with_effect(fit: CalibrationResult, effect: Effect, target: Target) -> CalibrationResult:
    """Add an effect to a simulation and fit it from the most promising starting points.

    The fit is returned as it is if no starting point changes the output, such as a limit that is not reached.
    """
    old, context = fit.simulation, fit.simulation.context
    extended = old.with_effects(catalogue_order((*old.effects, effect)))
    part = extended.get_slice(effect)
    residual = target.residual(fit.output)
    starts = []
    for point in effect.starting_points(context, target.y - fit.output):
        start = transfer_parameters(fit.values, old, extended)
        start[part] = extended.expand(effect, point)
        response = target.select(extended.simulate(start) - fit.output)
        energy = float(response @ response)
        if not 0.0 < energy < np.inf:
            continue
        projection = float(response @ residual)
        start[part][: effect.linear_parameters] *= projection / energy
        starts.append(
            (projection**2 / energy if effect.linear_parameters else 2 * projection - energy, start)
        )
    best = sorted(starts, key=lambda each: -each[0])[:_STARTS]
    fits = [calibrate(extended, target, start) for _, start in best]
    finite = (each for each in fits if np.isfinite(each.mean_square))
    return min(finite, key=lambda each: each.mean_square, default=fit)
