"""Cancellation: effects whose responses oppose each other, so that neither of their strengths is known.

Two effects of similar forms and opposite signs explain what is left of either, such as the error of the form
of one of them. Each alone carries over to another record, and their difference does not.
"""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import evaluate_fit
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.holdout import cross_validate_gain
from islands.diagnosis.inference.hypothesis import Hypothesis, remove_each, without_effect
from islands.diagnosis.inference.screening import transfer_parameters
from islands.effects.interface.effect import Effect

#: Size of a joint response, relative to the smaller one of two responses, below which they are one finding.
#: Creeps of two forms that made up for the intersample behaviour had 0.05.
MAX_CANCELLED = 0.25

#: The same below which each effect has to gain without the other one. Independent responses have 1.4.
MAX_OPPOSED = 0.7


def resolve_cancellation(
    hypothesis: Hypothesis, target: Target, rng: np.random.Generator
) -> tuple[Hypothesis, Mapping[str, tuple[str, ...]]]:
    """Keep the better one of two effects that cancel, and those that gain on blocks that are left out.

    Under model error, causes may mask each other: only those that cancel are one finding.

    Returns
    -------
    Hypothesis
    mapping
        Causes that were removed, by the name of the effect from which the record does not tell them apart.
    """
    removed: dict[str, tuple[str, ...]] = {}
    while (found := _find_cancelled(hypothesis, target, rng)) is not None:
        kept, other, hypothesis = found
        removed[kept.name] = (*removed.get(kept.name, ()), other.cause, *removed.pop(other.name, ()))
    return hypothesis, removed


def _find_cancelled(
    hypothesis: Hypothesis, target: Target, rng: np.random.Generator
) -> tuple[Effect, Effect, Hypothesis] | None:
    """Return two effects that are one finding, the better one first, and the hypothesis with that one."""
    sizes = {
        pair: measure_cancellation(hypothesis, pair, target) for pair in combinations(hypothesis.effects, 2)
    }
    for pair in sorted(sizes, key=lambda each: sizes[each]):
        if sizes[pair] >= MAX_OPPOSED:
            break
        alone = dict(zip(pair[::-1], remove_each(hypothesis, pair, target), strict=True))
        kept, other = sorted(pair, key=lambda each: alone[each].cost)
        if sizes[pair] < MAX_CANCELLED or not (
            _whiten_together(hypothesis, alone) or _gain_alone(alone, target, rng)
        ):
            return kept, other, alone[kept]
    return None


def _whiten_together(hypothesis: Hypothesis, alone: Mapping[Effect, Hypothesis]) -> bool:
    """Return whether two effects leave white noise, and neither of them alone does."""
    return not hypothesis.fit.noise.order and all(each.fit.noise.order for each in alone.values())


def _gain_alone(alone: Mapping[Effect, Hypothesis], target: Target, rng: np.random.Generator) -> bool:
    """Return whether each effect gains without the other one, on blocks that are left out of the fits."""
    if target.effective_samples is not None:
        return True
    for effect, found in alone.items():
        neither = without_effect(found, effect, target)
        if cross_validate_gain(neither.fit, False, found.fit, target, rng) <= 0.0:
            return False
    return True


def measure_cancellation(hypothesis: Hypothesis, pair: tuple[Effect, Effect], target: Target) -> float:
    """Return the size of the joint response of two effects, relative to the smaller one of their responses.

    Responses are changes of the output without an effect, at the values of the hypothesis, and without the
    part that other parameters reproduce. It is infinite if the simulation diverges without an effect.
    """
    fit, responses = hypothesis.fit, []
    others = tuple(each for each in hypothesis.effects if each not in pair)
    for kept in ((*others, pair[0]), (*others, pair[1]), others):
        simulation = fit.simulation.with_effects(kept)
        values = transfer_parameters(fit.values, fit.simulation, simulation)
        reduced = evaluate_fit(simulation, target, values)
        responses.append(fit.output - reduced.output)
    if not np.isfinite(responses).all():
        return np.inf
    projection = Projection(reduced, target)
    *alone, together = (float(np.linalg.norm(projection(each))) for each in responses)
    return together / min(alone) if min(alone) > 0.0 else np.inf
