"""Search for effects that need other values or equations of a linear simulation than its calibration has.

Its differential equations have limits of states and forces on a position, and it has not. Behind a sensor of
the absolute value, it has other values.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from islands.diagnosis.calibration.intersample_selection import (
    get_discretisation,
    select_intersample,
)
from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    evaluate_fit,
    whiten_target,
)
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.equation_simulator import find_equations
from islands.diagnosis.discovery.jumping_inputs import find_stick_slip, fit_jumping_inputs
from islands.diagnosis.discovery.state_equations import list_process_fits, list_state_fits
from islands.diagnosis.discovery.unsigned_output import fit_unsigned_output
from islands.diagnosis.inference.finding import EQUIVALENCE_MARGIN
from islands.diagnosis.inference.hypothesis import Hypothesis
from islands.diagnosis.inference.screening import (
    ScreenedEffect,
    bic_penalty,
    compute_cost,
    screen_effects,
    transfer_parameters,
)
from islands.diagnosis.inference.stepwise_search import stepwise_search
from islands.diagnosis.inference.strategies import SearchOutcome, assess_evidence, make_outcome
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.run import DiagnosisRun
from islands.effects.interface.effect import Effect, Site
from islands.effects.nonlinearity import STATE_CLIP, STATE_RANGE
from islands.simulators.interface import Simulator


def search_inner_effects(
    outcome: SearchOutcome,
    base: CalibrationResult,
    target: Target,
    run: DiagnosisRun,
    is_white: bool = False,
) -> SearchOutcome:
    """Return the outcome of a search in equations with an effect inside of them, if that explains more.

    Parameters
    ----------
    outcome : SearchOutcome
        Outcome of a search for effects.
    base : CalibrationResult
        The simulation without effects, calibrated to unweighted residuals.
    target, run
        Arguments of the search.
    is_white : bool
        Whether no effect was found and the residual is white. Only the errors of an actuator that moves in
        jumps are that random from one sample to the next, so that only these are searched for.

    Returns
    -------
    SearchOutcome
        The given one if no such effect fits better by the margin of equivalents, or none withstands the
        tests. The base of another one is a fit of the equations.
    """
    inner = _find_best_effect(outcome.hypothesis, base, target, run, is_white)
    if inner is None:
        return outcome
    inner = replace(inner, fit=_select_simulator(inner.fit, target))
    inner = _find_opposite_limits(inner, base, target) or inner
    simulator = inner.fit.simulation.simulator
    own = run.with_effects(list_effects(simulator, run, [inner.effect]))
    searched = _search_with(inner, base, target, own)
    # The other effects had hidden that another intersample behaviour or a finer step fits better.
    fit = _select_simulator(searched.hypothesis.fit, searched.target)
    has_inner = inner.effect in fit.simulation.effects
    if has_inner and get_discretisation(fit.simulation.simulator) != get_discretisation(simulator):
        searched = _search_with(replace(inner, fit=fit), base, target, own)
    if (slipping := find_stick_slip(searched.hypothesis, searched.target, run)) is not None:
        inner = slipping
        own = run.with_effects(list_effects(simulator, run, [inner.effect]))
        searched = _search_with(inner, base, target, own)
    found = assess_evidence(searched, own)
    possible = [inner.effect, *_list_inner_effects(simulator, run)]
    is_inner = any(effect in possible for effect in found.hypothesis.effects)
    return found if is_inner and found.verdict != Verdict.UNKNOWN else outcome


def _select_simulator(fit: CalibrationResult, target: Target) -> CalibrationResult:
    """Return a fit with the intersample behaviour and the step that suit the record."""
    simulation = replace(fit.simulation, simulator=select_intersample(fit, target))
    return calibrate(simulation, target, fit.values)


def _search_with(
    inner: ScreenedEffect, base: CalibrationResult, target: Target, run: DiagnosisRun
) -> SearchOutcome:
    """Search for effects next to an inner one, beginning with all effects of its fit."""
    simulation, fit = inner.fit.simulation, inner.fit
    if fit.noise.order:  # Ordinary least squares would fit the coloured noise as well.
        target = whiten_target(target, fit)
        fit = calibrate(simulation, target, fit.values)
    bare = simulation.with_effects(())
    given = transfer_parameters(fit.values, simulation, bare)
    is_known = simulation.simulator is base.simulation.simulator
    without = calibrate(bare, target, base.values if is_known else given)
    others = screen_effects(without, target, run.without_effects([inner.effect]))
    single, start = [ScreenedEffect(inner.effect, fit)], None
    if len(simulation.effects) > 1:
        single = screen_effects(without, target, run.with_effects([inner.effect]))
        start = Hypothesis(fit, compute_cost(fit, base), simulation.effects)
    screened = [*single, *others]
    hypothesis, target = stepwise_search(without, screened, target, run, start=start)
    return make_outcome(without, screened, target, hypothesis)


def _find_opposite_limits(
    inner: ScreenedEffect, base: CalibrationResult, target: Target
) -> ScreenedEffect | None:
    """Return opposite limits in place of a range of a state if they are about as good; None otherwise.

    With a large step, in which a state meets its limits at the wrong instants, a range may have been better.
    """
    simulation, state = inner.fit.simulation, inner.effect.name.partition(":")[2]
    opposite = {each.name: each for each in simulation.simulator.state_effects}.get(
        f"{STATE_CLIP.name}:{state}"
    )
    if inner.effect.cause != STATE_RANGE.name or opposite is None:
        return None
    other = simulation.with_effects((opposite,))
    start = transfer_parameters(inner.fit.values, simulation, other)
    start[other.get_slice(opposite)] = np.abs(inner.fit.values[simulation.get_slice(inner.effect)]).mean()
    fit = calibrate(other, target, start)
    margin = bic_penalty(inner.effect, base) - bic_penalty(opposite, base) + EQUIVALENCE_MARGIN
    return ScreenedEffect(opposite, fit) if fit.score < inner.fit.score + margin else None


def list_effects(simulator: Simulator, run: DiagnosisRun, found: Sequence[Effect]) -> list[Effect]:
    """Return the effects of a run that equations of a linear simulation lack, and those of their states.

    Opposite limits of a state are a special case of a range, which would be no other cause. There are ranges
    only if effects that were found contain one.
    """
    kept = [effect for effect in run.effects if effect.name not in simulator.built_in_effects]
    is_range = any(effect.cause == STATE_RANGE.name for effect in found)
    left_out = STATE_CLIP.name if is_range else STATE_RANGE.name
    return [*kept, *(effect for effect in simulator.state_effects if effect.cause != left_out)]


def _list_inner_effects(simulator: Simulator, run: DiagnosisRun) -> list[Effect]:
    """Return the effects that act in the equations of a linear simulation and not at its ends."""
    equations = find_equations(simulator)
    assert equations is not None
    force = equations.system.force
    is_oscillator = force is not None and bool(force.rate)
    forces = [effect for effect in run.effects if is_oscillator and effect.site == Site.FORCE]
    built_in = simulator.built_in_effects
    return [*(effect for effect in forces if effect.name not in built_in), *simulator.state_effects]


def _find_best_effect(
    alone: Hypothesis, base: CalibrationResult, target: Target, run: DiagnosisRun, is_white: bool
) -> ScreenedEffect | None:
    """Return the inner effect with the best fit; None if none fits better than the effects of a hypothesis.

    The values of a simulation that lacks the effect may be far from those of the plant. Those with an effect
    that imitates it are closer.
    """
    # The scores of a search with model error count other samples.
    scored = evaluate_fit(alone.fit.simulation, target, alone.fit.values)
    best, least = None, compute_cost(scored, base) - EQUIVALENCE_MARGIN
    starts = [base, scored] if alone.effects else [base]
    screened = [each for start in starts for each in fit_jumping_inputs(start, target, run)]
    if not is_white:
        screened += _fit_within_equations(starts, base, target, run)
    for each in screened:
        cost = compute_cost(each.fit, base)
        if cost < least:
            best, least = each, cost
    return best


def _fit_within_equations(
    starts: Sequence[CalibrationResult], base: CalibrationResult, target: Target, run: DiagnosisRun
) -> list[ScreenedEffect]:
    """Return fits of the effects that other values or equations of a linear simulation permit."""
    unsigned = fit_unsigned_output(base, target, run)
    found = [] if unsigned is None else [unsigned]
    fits = [states for start in starts for states in list_state_fits(start, target)]
    for states in [*fits, *list_process_fits(base, target)]:
        inner = _list_inner_effects(states.simulation.simulator, run)
        found += screen_effects(states, target, run.with_effects(inner))
    return found
