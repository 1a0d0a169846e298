"""The oracle: who is told the names of what is hidden, and only has to fit."""

from collections.abc import Mapping, Sequence

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, Target, calibrate
from islands.discrepancy.calibration.preparation import select_effects
from islands.discrepancy.diagnosis import Diagnosis
from islands.discrepancy.effects import catalogue_order, model_form
from islands.discrepancy.interfaces.effect import Effect

#: Starts of each effect that are fitted, of those that promise most.
_STARTS = 3

#: Part of the error by which the oracle's has to be smaller, or there is no gain to have a share of.
_LEAST = 0.01


def share_of_gain(found: Diagnosis, names: Sequence[str], tolerance: Mapping[str, float]) -> float | None:
    """Return what a diagnosis gained on the locked samples, relative to the oracle.

    Parameters
    ----------
    found : Diagnosis
    names : sequence of str
        What is hidden.
    tolerance : mapping
        What the diagnosis was given.

    Returns
    -------
    float or None
        None where the oracle gains next to nothing, or has no names for it either.
    """
    target = Target(
        found.record.y, np.arange(found.record.samples) < found.estimation_samples, None, tolerance
    )
    simulation = found.base.simulation
    effects = select_effects(simulation.simulator, simulation.context, tolerance)
    told = found.base
    # That its own form is wrong is no gain of a cause: both are held against the model with that mended.
    for form in (effect for effect in effects if effect.name == model_form.CORE_SHAPE):
        told = _fitted(told, form, target)
    before = _error(found, told)
    for name in names:
        alike = [effect for effect in effects if effect.name.partition(":")[0] == name]
        if not alike:
            return None
        told = min((_fitted(told, effect, target) for effect in alike), key=lambda fit: fit.mean_square)
    if told.noise.order:
        told = calibrate(
            told.simulation, Target(target.y, target.estimation_part, told.noise, tolerance), told.values
        )
    after, best = _error(found, found.best), _error(found, told)
    return (before - after) / (before - best) if best < (1.0 - _LEAST) * before else None


def _error(found: Diagnosis, fit: CalibrationResult) -> float:
    """Return the RMSE over the locked samples."""
    return float(np.sqrt(np.mean((found.record.y - fit.output)[found.estimation_samples :] ** 2)))


def _fitted(fit: CalibrationResult, effect: Effect, target: Target) -> CalibrationResult:
    """Return a simulation with one more effect in it, fitted from the starts that promise most."""
    old, context = fit.simulation, fit.simulation.context
    extended = old.with_effects(catalogue_order((*old.effects, effect)))
    part, own = extended.get_slice(effect), len(old.simulator.parameters)
    residual = target.residual(fit.output)
    starts = []
    for point in effect.starting_points(context, target.y - fit.output):
        start = extended.nominal
        start[:own] = fit.values[:own]
        for each in old.effects:
            start[extended.get_slice(each)] = fit.values[old.get_slice(each)]
        start[part] = point
        response = target.select(extended.simulate(start) - fit.output)
        size = float(response @ response)
        if not 0.0 < size < np.inf:
            continue
        along = float(response @ residual)
        start[part][: effect.linear_parameters] *= along / size
        starts.append((along**2 / size if effect.linear_parameters else 2 * along - size, start))
    best = sorted(starts, key=lambda each: -each[0])[:_STARTS]
    fits = [calibrate(extended, target, start) for _, start in best]
    return min((each for each in fits if np.isfinite(each.mean_square)), key=lambda each: each.mean_square)
