"""Search for limits of the states inside of a linear simulation, which its equations have and it has not."""

from dataclasses import replace

from islands.diagnosis.calibration.intersample_selection import select_intersample
from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    evaluate_fit,
    whiten_target,
)
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.state_equations import list_state_fits
from islands.diagnosis.inference.finding import EQUIVALENCE_MARGIN
from islands.diagnosis.inference.hypothesis import Hypothesis
from islands.diagnosis.inference.screening import (
    ScreenedEffect,
    bic_penalty,
    screen_effects,
    transfer_parameters,
)
from islands.diagnosis.inference.stepwise_search import stepwise_search
from islands.diagnosis.inference.strategies import SearchOutcome, assess_evidence, make_outcome
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.run import DiagnosisRun


def search_state_limits(
    outcome: SearchOutcome, base: CalibrationResult, target: Target, run: DiagnosisRun
) -> SearchOutcome:
    """Return the outcome of a search in equations with a limit of a state, if that explains more.

    Parameters
    ----------
    outcome : SearchOutcome
        Outcome of a search for effects.
    base : CalibrationResult
        The simulation without effects, calibrated to unweighted residuals.
    target, run
        Arguments of the search.

    Returns
    -------
    SearchOutcome
        The given one if no limit fits better by the margin of equivalents, or none withstands the tests. The
        base of another one is a fit of the equations.
    """
    limited = _find_best_limit(outcome.hypothesis, base, target, run)
    if limited is None:
        return outcome
    simulator = select_intersample(limited.fit, target)
    simulation = replace(limited.fit.simulation, simulator=simulator)
    fit = calibrate(simulation, target, limited.fit.values)
    if fit.noise.order:  # Ordinary least squares would fit the coloured noise as well.
        target = whiten_target(target, fit)
        fit = calibrate(simulation, target, fit.values)
    bare = simulation.with_effects(())
    without = calibrate(bare, target, transfer_parameters(fit.values, simulation, bare))
    own = run.with_effects([*run.effects, *simulator.state_effects])
    others = screen_effects(without, target, own.without_effects([limited.effect]))
    screened = [ScreenedEffect(limited.effect, fit), *others]
    hypothesis, target = stepwise_search(without, screened, target, own)
    found = assess_evidence(make_outcome(without, screened, target, hypothesis), own)
    is_limited = any(effect in simulator.state_effects for effect in found.hypothesis.effects)
    return found if is_limited and found.verdict != Verdict.UNKNOWN else outcome


def _find_best_limit(
    alone: Hypothesis, base: CalibrationResult, target: Target, run: DiagnosisRun
) -> ScreenedEffect | None:
    """Return the limit with the best fit; None if none fits better than the effects of a hypothesis.

    The values of a simulation that lacks the limit may be far from those of the plant. Those with an effect
    that imitates it are closer.
    """
    # The scores of a search with model error count other samples.
    scored = evaluate_fit(alone.fit.simulation, target, alone.fit.values)
    best, least = None, scored.score + sum(bic_penalty(effect, base) for effect in alone.effects)
    least -= EQUIVALENCE_MARGIN
    for start in (base, alone.fit) if alone.effects else (base,):
        for states in list_state_fits(start, target):
            limits = states.simulation.simulator.state_effects
            for each in screen_effects(states, target, run.with_effects(limits)):
                cost = each.fit.score + bic_penalty(each.effect, base)
                if cost < least:
                    best, least = each, cost
    return best
