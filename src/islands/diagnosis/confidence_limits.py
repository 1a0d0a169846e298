"""Limits of the confidence of causes that a further record may refute.

What causes leave next to white noise may be coloured noise, or an error of the simulation that has another
cause. A record of one input does not tell these apart. In trials, a cause that leaves a coloured part of more
than a twentieth of the misfit is named right in about 87 % of the records with coloured noise, and in none of
the records with a law that is not in the catalogue.

An actuator that moves in jumps responds to each level of a held input by one of few positions. A record of
some dozen levels leaves a range of its values open, and one wrong position on a further record lasts until
the next level.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.finding import Finding
from islands.diagnosis.inference.verdict import Verdict, choose_reference_fit
from islands.diagnosis.result import Diagnosis
from islands.effects.hysteresis import is_held
from islands.effects.interface.context import Signal
from islands.records.noise_model import fit_noise

#: Coloured part of the misfit up to which a cause explains it.
MAX_COLOURED_FRACTION = 0.05

#: Largest confidence of a cause that leaves more, or whose values are open; and of one that leaves more
#: without a significant gain on the hold-out part, or diverges with another input.
MAX_CONFIDENCE, MAX_CONFIDENCE_WITHOUT_GAIN = 0.85, 0.5

#: Why such an extension is not offered.
_REFUSAL = (
    "The extended simulation is not offered: it does not reduce the error on the hold-out part "
    "significantly, and leaves a coloured error."
)


def limit_confidences(found: Diagnosis, target: Target) -> Diagnosis:
    """Return a diagnosis without a larger confidence than its remainder, values and extension allow.

    An extension that leaves a coloured error and has no significant gain on the hold-out part is not offered.

    Parameters
    ----------
    found : Diagnosis
    target : Target
    """
    jumps = _list_open_jumps(found)
    found = _limit(found, MAX_CONFIDENCE, lambda each: each.name in jumps)
    if found.trial is not None and found.trial.is_unstable:
        found = _limit(found, MAX_CONFIDENCE_WITHOUT_GAIN, _is_cause)
    if not found.causes or measure_coloured_fraction(found, target) <= MAX_COLOURED_FRACTION:
        return found
    has_gain = found.gain is not None and found.gain.ci95[0] > 0.0
    limit = MAX_CONFIDENCE if has_gain else MAX_CONFIDENCE_WITHOUT_GAIN
    found = _limit(found, limit, _is_cause)
    if has_gain or found.trial is None or found.trial.refusal:
        return found
    return replace(found, trial=replace(found.trial, refusal=_REFUSAL))


def _list_open_jumps(found: Diagnosis) -> set[str]:
    """Return the names of effects that jump behind an input that is held at few levels."""
    simulation = found.best.simulation
    if not is_held(simulation.context.u):
        return set()
    return {each.name for each in simulation.effects if each.centre is not None}


def _is_cause(finding: Finding) -> bool:
    """Return whether a finding is a cause, and no property of the noise."""
    return finding.explained_fraction is not None


def _limit(found: Diagnosis, limit: float, concerns: Callable[[Finding], bool]) -> Diagnosis:
    """Return a diagnosis with this confidence at most of the effects that it concerns."""
    effects = tuple(
        replace(each, confidence=min(each.confidence, limit)) if concerns(each) else each
        for each in found.effects
    )
    return replace(found, effects=effects)


def measure_coloured_fraction(found: Diagnosis, target: Target) -> float:
    """Return the coloured part of the residual relative to the misfit, in mean squares without white noise.

    The white part is the variance of the innovations of an autoregression.
    """
    has_terms = found.verdict == Verdict.DISCOVERED
    effects = found.best.simulation.effects
    reference = found.base if has_terms else choose_reference_fit(effects, found.base, target)
    residuals: list[Signal] = [
        (target.y - each.output)[target.estimation_part] for each in (reference, found.best)
    ]
    before, after = (float(np.mean(each**2)) for each in residuals)
    white = fit_noise(residuals[1], segments=target.fitted_segments).variance
    return (after - white) / (before - white) if before > after else float(after > white)
