"""Pairs of effects that explain a residual together, by their linear responses.

Two causes that oppose each other explain little as long as one of them is missing, and a noise model takes
the difference of their responses for noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, evaluate_fit
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.hypothesis import Hypothesis, with_effect
from islands.diagnosis.inference.screening import (
    bic_penalty,
    extend,
    scale_strengths,
    screen_effects,
    simulate_starting_points,
)
from islands.diagnosis.run import DiagnosisRun
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect
from islands.simulators.extended import ExtendedSimulator

#: Largest squared correlation of the responses of a pair. More similar ones differ by less than the error of
#: their linearisation.
MAX_DEPENDENCE = 0.99


@dataclass(frozen=True, slots=True, eq=False)
class EffectPair:
    """Two effects that explain a residual together.

    Attributes
    ----------
    gain : float
        Decrease of minus twice the log-likelihood by the linear responses to both.
    first, second : Effect
    start : ndarray, shape (parameters,)
        Values of the simulation with the first effect, whose strength is that of the pair.
    """

    gain: float
    first: Effect
    second: Effect
    start: Signal


@dataclass(frozen=True, slots=True, eq=False)
class _Response:
    """Response to an effect at one of its starting points, of unit size."""

    effect: Effect
    simulation: ExtendedSimulator
    start: Signal
    size: float
    unit: Signal


def rank_pairs(
    fit: CalibrationResult, target: Target, effects: Sequence[Effect], count: int, count_of_effect: int
) -> list[EffectPair]:
    """Return the pairs of effects whose linear responses explain most of the residual of a fit together.

    Each effect responds at each of its starting points, and calibration absorbs its part of the response.

    Parameters
    ----------
    fit : CalibrationResult
    target : Target
    effects : sequence of Effect
        Effects that the simulation of the fit does not have.
    count, count_of_effect : int
        Maximum number of pairs, and of those with the same effect: a jump at any time explains much of any
        residual.
    """
    projection = Projection(fit, target)
    responses = [each for effect in effects for each in _list_responses(fit, target, effect, projection)]
    if not responses:
        return []
    units = np.column_stack([each.unit for each in responses])
    gram, products = units.T @ units, units.T @ projection.residual
    owners = np.array([effects.index(each.effect) for each in responses])
    first, second = np.nonzero(owners[:, None] < owners)
    common, p, q = gram[first, second], products[first], products[second]
    rest = 1.0 - common**2
    explained = np.where(
        rest > 1.0 - MAX_DEPENDENCE, (p * p + q * q - 2.0 * common * p * q) / np.maximum(rest, 1e-300), 0.0
    )
    whole = float(projection.residual @ projection.residual)
    pairs: dict[tuple[int, int], EffectPair] = {}
    uses = np.zeros(len(effects), dtype=np.intp)
    for index in np.argsort(-explained, kind="stable"):
        if not explained[index] > 0.0:
            break
        i, j = first[index], second[index]
        both = [owners[i], owners[j]]
        if (owners[i], owners[j]) in pairs or uses[both].max() == count_of_effect:
            continue
        uses[both] += 1
        start, weight = responses[i], (p[index] - common[index] * q[index]) / rest[index]
        pairs[owners[i], owners[j]] = EffectPair(
            projection.score_decrease(whole - float(explained[index])),
            start.effect,
            responses[j].effect,
            _scale(start, float(weight)),
        )
        if len(pairs) == count:
            break
    return list(pairs.values())


def add_pair(
    hypothesis: Hypothesis, pair: EffectPair, target: Target, run: DiagnosisRun
) -> Hypothesis | None:
    """Return a hypothesis with a pair of effects, calibrated; None if the second one has no response."""
    simulation = extend(hypothesis.fit, pair.first)
    first = evaluate_fit(simulation, target, pair.start)
    if not np.isfinite(first.score):
        return None
    cost = hypothesis.cost + first.score - hypothesis.fit.score + bic_penalty(pair.first, hypothesis.fit)
    start = Hypothesis(first, cost, (*hypothesis.effects, pair.first))
    screened = screen_effects(first, target, run.with_effects([pair.second]))
    return with_effect(start, screened[0]) if screened else None


def _list_responses(
    fit: CalibrationResult, target: Target, effect: Effect, projection: Projection
) -> list[_Response]:
    simulation = extend(fit, effect)
    points, changes = simulate_starting_points(fit, simulation, effect, target)
    projected = [projection(change) for change in changes]
    sizes = [float(np.linalg.norm(each)) for each in projected]
    return [
        _Response(effect, simulation, point, size, each / size)
        for point, each, size in zip(points, projected, sizes, strict=True)
        if 0.0 < size < np.inf
    ]


def _scale(response: _Response, weight: float) -> Signal:
    """Return the starting point of a response with its strength scaled to a weight, if that is possible."""
    factors = np.array([weight / response.size])
    return scale_strengths(response.simulation, response.effect, response.start[None], factors)[0]
