"""Discovery of missing terms: equations with more terms that explain a record better than the catalogue."""

import re
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    estimate_deviations,
    evaluate_fit,
)
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.equation_simulator import get_system
from islands.diagnosis.discovery.joint_search import JointResult, assess_effects, search_jointly
from islands.diagnosis.discovery.process_laws import describe_law
from islands.diagnosis.discovery.state_equations import calibrate_states, list_state_fits
from islands.diagnosis.discovery.term_search import TermSearchResult, search_terms
from islands.diagnosis.inference.confidence import CONFIDENCE_TEMPERATURE
from islands.diagnosis.inference.finding import EQUIVALENCE_MARGIN, Finding, Rival, Value
from islands.diagnosis.inference.holdout import (
    bound_reduction,
    compute_holdout_errors,
    cross_validate_gain,
)
from islands.diagnosis.inference.hypothesis import Hypothesis
from islands.diagnosis.inference.screening import bic_penalty
from islands.diagnosis.inference.strategies import SearchOutcome, analyse_residual
from islands.diagnosis.inference.verdict import Verdict, explained_fraction, noise_fraction
from islands.diagnosis.run import DiagnosisRun
from islands.simulators.output_equation import OutputEquation

#: Part of the gain of the terms by which they have to be better than effects. The catalogue has one form of
#: each effect, and another one, such as a sign for a smoothed sign, is no other cause.
MIN_RELATIVE_GAIN = 0.1

#: Score by which terms that begin or end within the record have to be better than effects: with an instant, a
#: simple law imitates an effect with memory, such as a creep.
GATED_MARGIN = 3.0 * EQUIVALENCE_MARGIN

#: Terms that are the law of an effect, which the catalogue has smoothed, as regular expressions.
SMOOTHED_LAWS = {"coulomb-friction": r"sign\([^*]*\)"}

#: Name and family of a discovered term in findings.
MISSING_TERM, FAMILY = "missing-term", "discovered"


@dataclass(frozen=True, slots=True)
class Discovery:
    """Equations with missing terms, and the nearest effects of the catalogue.

    Attributes
    ----------
    equations : str
        Extended equations, and the values of their new parameters.
    effects : tuple of str
        Names of the effects that act in addition to the terms.
    nearest : tuple of str
        Names of the effects that explain the record best without the terms, except those in ``effects``.
    worse_by : float
        Difference between the score of the effects and that of the equations; negative if effects without
        terms explain the record better.
    """

    equations: str
    effects: tuple[str, ...]
    nearest: tuple[str, ...]
    worse_by: float


@dataclass(frozen=True, slots=True)
class MissingTerms:
    """Result of a search for missing terms, compared with the effects of the catalogue.

    Attributes
    ----------
    search : TermSearchResult
    discovery : Discovery
    outcome : SearchOutcome or None
        Effects that act in addition to the terms.
    """

    search: TermSearchResult
    discovery: Discovery
    outcome: SearchOutcome | None = None

    @property
    def rival(self) -> Rival | None:
        """Missing terms as an alternative of the effects, at most as good; None if they are the same law.

        If they were better by more than another form of an effect, they would replace it.
        """
        law = SMOOTHED_LAWS.get(" ".join(self.discovery.nearest))
        if law is not None and all(re.fullmatch(law, each.term.text) for each in self.search.terms):
            return None
        lead = min(self.discovery.worse_by, 0.0)
        return Rival(MISSING_TERM, self.search.fit, lead, len(self.search.terms), self.search.effects)

    def is_better(self, alone: SearchOutcome) -> bool:
        """Return whether the terms explain clearly more than effects alone."""
        found, hypothesis = self.search, alone.hypothesis
        margin = max(EQUIVALENCE_MARGIN, MIN_RELATIVE_GAIN * found.gain)
        if any(effect.is_free for effect in hypothesis.effects):
            margin = 0.0  # A formula is preferred to a curve that explains as much.
        else:
            values = sum(len(term.parameters) for term in found.terms)
            if values + _count_values(found.fit) < _count_values(hypothesis.fit):
                margin = EQUIVALENCE_MARGIN  # Effects with more values are no idealisation of the terms.
        if any(each.term.gate for each in found.terms):
            margin = max(margin, GATED_MARGIN)
        return self.discovery.worse_by >= margin


class TermSearches:
    """Searches for terms in a simulation without effects, each of which runs once.

    Terms of a linear simulation act at its output, or in its differential equations.

    Parameters
    ----------
    base : CalibrationResult
        The simulation without effects, calibrated to unweighted residuals.
    target : Target
        Target of ``base``.
    run : DiagnosisRun
    """

    def __init__(self, base: CalibrationResult, target: Target, run: DiagnosisRun) -> None:
        self.base, self.target, self.run = base, target, run
        self._found: dict[CalibrationResult, TermSearchResult | None] = {}

    @cached_property
    def inner(self) -> list[CalibrationResult]:
        """Differential equations of a linear simulation, calibrated."""
        # The search moves the time constants, so that one order of the processes is enough.
        return [calibrate_states(each, self.target) for each in list_state_fits(self.base, self.target)[:1]]

    def restrict(self, run: DiagnosisRun, start: CalibrationResult) -> DiagnosisRun:
        """Return a run for the terms of one of the simulations."""
        return run if start is self.base else replace(run, has_inner_terms_only=True)

    def search(self, start: CalibrationResult, least: float = np.inf) -> TermSearchResult | None:
        """Search for terms in one of the simulations.

        Parameters
        ----------
        least : float
            Cost of another explanation; see `search_terms`. An earlier search may have more terms.
        """
        if start not in self._found:
            self._found[start] = search_terms(start, self.target, self.restrict(self.run, start), least)
        return self._found[start]


def find_missing_terms(
    searches: TermSearches, alone: SearchOutcome, run: DiagnosisRun
) -> MissingTerms | None:
    """Search for missing terms, and compare them with the effects of the catalogue.

    Effects in addition to the terms are searched for if neither a single effect nor a single term explains
    the record alone.

    Parameters
    ----------
    searches : TermSearches
    alone : SearchOutcome
        Outcome of the search for effects. If it has none, the nearest one is the best of those screened.
    run : DiagnosisRun
        Run of the search for effects in addition to terms.

    Returns
    -------
    MissingTerms or None
        None if no term gains enough.
    """
    first = _find_terms(searches, searches.base, alone, run)
    if alone.leaves_white_noise and not (first is not None and first.is_better(alone)):
        return first
    found = [first, *(_find_terms(searches, start, alone, run) for start in searches.inner)]
    known = [each for each in found if each is not None]
    return max(known, key=lambda each: (each.is_better(alone), -each.search.cost), default=None)


def _find_terms(
    searches: TermSearches, base: CalibrationResult, alone: SearchOutcome, run: DiagnosisRun
) -> MissingTerms | None:
    """Search for missing terms in one simulation."""
    target, run = searches.target, searches.restrict(run, base)
    effects_alone = _score_effects(alone, base, target)
    found = searches.search(base, effects_alone.cost)
    tested = None
    if found is not None:
        # A delay instead of a term has to pass the tests of effects.
        tested = assess_effects(found, target, run) if found.effects else JointResult(found)
    terms = None if tested is None else _compare(tested, effects_alone)
    if alone.target.effective_samples is not None:
        return terms  # A search with model error has no noise model that further effects could whiten.
    is_better = terms is not None and terms.is_better(alone)
    if not is_better and len(alone.hypothesis.effects) == 1 and alone.verdict == Verdict.NAMED:
        return terms
    if terms and is_better:
        leaves_white_noise = len(terms.search.terms) == 1 and not terms.search.fit.noise.order
        if leaves_white_noise or _is_contradicted(terms.search.fit, effects_alone.fit, target, run.rng):
            return terms
    joint = search_jointly(found, base, alone, effects_alone.cost, target, run)
    if joint is None:
        return terms
    together = _compare(joint, effects_alone)
    if terms is None or (together.is_better(alone), -joint.terms.cost) > (is_better, -terms.search.cost):
        return together
    return terms


def explain_all(searches: TermSearches, seed: int, is_noise: bool) -> bool:
    """Return whether missing terms of a simulation without equations leave nothing but noise.

    Its terms are found in a tenth of the time that the search with model error takes. Of other simulations it
    returns False.

    Parameters
    ----------
    searches : TermSearches
    seed : int
        Seed of the surrogates of the residual.
    is_noise : bool
        Whether the residual without terms may be coloured noise. The terms then have to leave white noise.
    """
    if not isinstance(searches.base.simulation.simulator, OutputEquation):
        return False
    return _leaves_noise(searches, searches.base, seed, is_noise) or any(
        _leaves_noise(searches, start, seed, is_noise) for start in searches.inner
    )


def _leaves_noise(searches: TermSearches, start: CalibrationResult, seed: int, is_white: bool) -> bool:
    """Return whether the missing terms of one simulation leave nothing but noise."""
    found = searches.search(start)
    if found is None or (is_white and found.fit.noise.order):
        return False
    return not analyse_residual(found.fit, searches.target, np.random.default_rng(seed)).is_structured


def _is_contradicted(
    after: CalibrationResult, before: CalibrationResult, target: Target, rng: np.random.Generator
) -> bool:
    """Return whether a fit with the better score has the larger error in the hold-out part.

    The residual is then no noise, and scores of further terms say nothing.
    """
    old, new = (compute_holdout_errors(each, target) for each in (before, after))
    return bound_reduction(old, new, rng)[1] < 0.0


def _score_effects(alone: SearchOutcome, base: CalibrationResult, target: Target) -> Hypothesis:
    """Return the effects alone, or the nearest one if there are none, with their cost for a target."""
    hypothesis = alone.hypothesis
    nearest = [] if hypothesis.effects else [each for each in alone.screened if not each.effect.is_free][:1]
    effects = hypothesis.effects or tuple(each.effect for each in nearest)
    fit = nearest[0].fit if nearest else hypothesis.fit
    # The scores of a search with model error count other samples.
    scored = evaluate_fit(fit.simulation, target, fit.values)
    return Hypothesis(scored, scored.score + sum(bic_penalty(effect, base) for effect in effects), effects)


def compare_terms(
    terms: MissingTerms, alone: SearchOutcome, base: CalibrationResult, target: Target
) -> MissingTerms:
    """Return missing terms that are compared with another outcome of the search for effects."""
    return _compare(JointResult(terms.search, terms.outcome), _score_effects(alone, base, target))


def _compare(joint: JointResult, alone: Hypothesis) -> MissingTerms:
    """Compare terms with effects alone."""
    terms = joint.terms
    added, replaced = (
        tuple(dict.fromkeys(effect.cause for effect in each))
        for each in (terms.effects, [effect for effect in alone.effects if effect not in terms.effects])
    )
    discovery = Discovery(terms.describe(), added, replaced, alone.cost - terms.cost)
    return MissingTerms(terms, discovery, joint.outcome)


def replaces_effects(
    terms: MissingTerms,
    base: CalibrationResult,
    alone: SearchOutcome,
    target: Target,
    rng: np.random.Generator,
) -> bool:
    """Return whether missing terms explain clearly more than effects, also on blocks that are left out.

    Parameters
    ----------
    base, alone, target
        Arguments of `find_missing_terms`.
    """
    if not terms.is_better(alone):
        return False
    return cross_validate_gain(base, False, terms.search.fit, target, rng) > 0.0


def _count_values(fit: CalibrationResult) -> int:
    """Count the values of the effects of a fit, without initial states."""
    context, effects = fit.simulation.context, fit.simulation.effects
    return sum(not parameter.initial for effect in effects for parameter in effect.parameters(context))


def describe_terms(
    found: TermSearchResult, discovery: Discovery, base: CalibrationResult, target: Target, floor: float
) -> tuple[Finding, ...]:
    """Return a finding for each term.

    Parameters
    ----------
    floor : float
        Mean square of the noise.
    """
    fit = found.fit
    deviations = estimate_deviations(fit, target)
    places = {parameter.name: index for index, parameter in enumerate(fit.simulation.parameters)}
    confidence = 1.0 / (1.0 + float(np.exp(-discovery.worse_by / (2 * CONFIDENCE_TEMPERATURE))))
    system = get_system(found.base)
    # Parameters of effects may have the names of others.
    fitted = {name: float(fit.values[place]) for name, place in places.items()}
    findings = []
    for each in found.terms:
        values = {}
        for name in each.parameters:
            unit = fit.simulation.parameters[places[name]].unit
            values[name] = Value.estimate(fitted[name], unit, float(deviations[places[name]]))
        findings.append(
            Finding(
                *(MISSING_TERM, FAMILY, confidence, (), values, each.gain),
                explained_fraction(base, fit, floor),
                error_fraction=explained_fraction(base, fit, 0.0),
                noise_fraction=noise_fraction(base, floor),
                term=each.describe(),
                summary=describe_law(each.term, each.number, system, fitted),
                depends_on_time=each.term.depends_on_time,
            )
        )
    return tuple(findings)
