"""Effects that replace missing terms.

A search for effects takes one at a time, and ends where no further one gains enough. Terms that explain more
together with effects show it a better start: with these effects, and the noise that the terms leave, another
effect may be as good as the terms.
"""

from dataclasses import replace

from islands.diagnosis.calibration.intersample_selection import get_discretisation, select_intersample
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate, whiten_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.joint_search import calibrate_with_effects
from islands.diagnosis.discovery.missing_terms import MissingTerms
from islands.diagnosis.inference.hypothesis import Hypothesis
from islands.diagnosis.inference.screening import compute_cost, screen_effects
from islands.diagnosis.inference.stepwise_search import MIN_GAIN, stepwise_search
from islands.diagnosis.inference.strategies import SearchOutcome, assess_evidence, make_outcome
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.run import DiagnosisRun


def search_instead_of_terms(
    terms: MissingTerms, alone: SearchOutcome, base: CalibrationResult, target: Target, run: DiagnosisRun
) -> SearchOutcome:
    """Return the outcome of a search that begins with the effects next to missing terms, if it is better.

    Parameters
    ----------
    terms : MissingTerms
    alone : SearchOutcome
        Outcome of the search for effects without terms.
    base, target, run
        Arguments of that search.

    Returns
    -------
    SearchOutcome
        The given one if there are no effects next to the terms, the terms are not better, or as many effects
        as there are effects and terms do not explain more.
    """
    found, given = terms.search, alone.hypothesis
    is_same = found.base.simulation.simulator.parameters == base.simulation.simulator.parameters
    if not found.effects or not is_same or not terms.is_better(alone):
        return alone
    run.progress("effects instead of missing terms")
    whitened = whiten_target(target, found.fit)
    fit = calibrate_with_effects(base, found.effects, found.fit, whitened)
    initial, screened = alone.base, alone.screened
    simulator = select_intersample(fit, whitened)
    if get_discretisation(simulator) != get_discretisation(fit.simulation.simulator):
        # The misfit that terms explain had hidden that another intersample behaviour fits better.
        initial = calibrate(replace(base.simulation, simulator=simulator), target, base.values)
        screened = screen_effects(initial, target, run)
        fit = calibrate(replace(fit.simulation, simulator=simulator), whitened, fit.values)
    start = Hypothesis(fit, compute_cost(fit, initial), found.effects)
    hypothesis, whitened = stepwise_search(initial, screened, whitened, run, start=start)
    is_larger = len(hypothesis.effects) > len(found.terms) + len(found.effects)
    if is_larger or hypothesis.cost > given.cost - MIN_GAIN:
        return alone
    outcome = assess_evidence(make_outcome(initial, screened, whitened, hypothesis), run)
    has_all = set(outcome.hypothesis.effects) == set(hypothesis.effects)
    return outcome if has_all and outcome.verdict != Verdict.UNKNOWN else alone
