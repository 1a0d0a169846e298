"""Assembly of a diagnosis from the outcome of its search: verdict, findings and gain on the hold-out part."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from islands.diagnosis.calibration.initial_states import fit_initial_states
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, evaluate_fit
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.effect_shape import compare_shapes
from islands.diagnosis.discovery.missing_terms import MISSING_TERM, MissingTerms, describe_terms
from islands.diagnosis.findings import describe_gross_errors, describe_noise, list_record_findings
from islands.diagnosis.gross_errors.explanation import GrossError
from islands.diagnosis.inference.finding import Finding, describe_effects
from islands.diagnosis.inference.holdout import HoldoutGain, bound_gain, compute_rmse, measure_gain
from islands.diagnosis.inference.residual_structure import find_residual_structure
from islands.diagnosis.inference.screening import ScreenedEffect, screen_effects
from islands.diagnosis.inference.strategies import SearchOutcome
from islands.diagnosis.inference.time_functions import leave_out_contradicted_time
from islands.diagnosis.inference.timing_alternatives import add_timing_alternatives
from islands.diagnosis.inference.verdict import Verdict, choose_reference_fit, classify, explained_fraction
from islands.diagnosis.planning.next_experiment import design_next_experiment
from islands.diagnosis.result import Candidate, Diagnosis
from islands.diagnosis.run import DiagnosisRun
from islands.records.dataset import Dataset

#: Effects are rejected if they increase the error of the hold-out part by more than this percentage, with a
#: certainty of 97.5 %. It is not zero, since an effect that calibration absorbs changes the RMSE by almost
#: nothing in either direction.
MAX_HOLDOUT_LOSS_PERCENT = 0.5

#: Confidence that a claimed cause has at least. Below it, others are more than five times as probable.
MIN_CONFIDENCE = 0.15


def make_gross_diagnosis(
    record: Dataset, base: CalibrationResult, errors: Sequence[GrossError], target: Target
) -> Diagnosis:
    """Describe gross errors. No effects are searched for; the best fit is that of the corrected record."""
    best = errors[0]
    return Diagnosis(
        verdict=Verdict.GROSS_ERROR,
        effects=describe_gross_errors(errors),
        candidates=(),
        gain=None,
        residual_structure={},
        next_experiment=None,
        record=record,
        estimation_samples=target.fitted,
        base=base,
        best=best.fit_of_record or base,
        noise_floor=best.rmse,
        is_noise_floor_measured=False,
        nominal_rmse=compute_rmse((record.y - base.output)[target.fitted :]),
        record_findings=list_record_findings(errors),
    )


def extend_equations(
    found: Diagnosis,
    terms: MissingTerms,
    target: Target,
    run: DiagnosisRun,
) -> Diagnosis:
    """Return the diagnosis with discovered terms in place of effects, if the hold-out part confirms them.

    Its error must not be larger with them than with the effects, by the rule for effects; if there are none,
    it has to be smaller than without the terms. The terms have to explain as much as effects would have to.
    """
    record, fitted = found.record, found.estimation_samples
    whole = fit_initial_states(terms.search.fit, target, fitted)
    factors = [each.parameters[0] for each in terms.search.terms if each.term.depends_on_time]
    fit = leave_out_contradicted_time(record, whole, target, run.rng, factors)
    holdout = slice(fitted, record.samples)
    floor = min(found.noise_floor, float(np.sqrt(fit.mean_square)))
    gain = measure_gain(record, found.base.output, fit.output, holdout, floor, run.rng)
    if found.gain is None:
        is_confirmed = gain.ci95[0] > 0.0
    else:
        compared = measure_gain(record, found.best.output, fit.output, holdout, floor, run.rng)
        is_confirmed = compared.ci95[1] >= -MAX_HOLDOUT_LOSS_PERCENT
    if not is_confirmed:
        return found
    residual, output = (record.y - fit.output)[:fitted], fit.output[:fitted]
    context = fit.simulation.context
    is_matched = target.is_matched(fit.output)
    seen = target.read_before_noise(context)
    structure = {} if is_matched else find_residual_structure(residual, output, seen, run.rng)
    if structure:  # The rest is no noise: only its innovations are.
        floor = min(floor, float(np.sqrt(fit.noise.variance)))
    explained = explained_fraction(found.base, fit, floor**2)
    if (
        classify(explained, has_effects=True, has_remainder=bool(structure), is_model_error=False)
        == Verdict.UNKNOWN
    ):
        return found
    findings = describe_terms(replace(terms.search, fit=fit), terms.discovery, found.base, target, floor**2)
    if (added := terms.outcome) is not None:
        # Alternatives of several effects are screened without each of them.
        is_single = len(added.hypothesis.effects) == 1
        screened = screen_effects(added.base, added.target, run) if is_single else ()
        added = replace(added, screened=screened, hypothesis=replace(added.hypothesis, fit=fit))
        described = describe_effects(add_timing_alternatives(added, run), run)[0]
        findings += tuple(map(_withdraw_improbable, described))
    return replace(
        found,
        verdict=Verdict.DISCOVERED,
        effects=(*findings, *describe_noise(record.y[:fitted], residual, context)),
        gain=gain,
        residual_structure=structure,
        next_experiment=None,
        best=fit,
        noise_floor=floor,
        discovery=terms.discovery,
        shape=None,
        is_time_left_out=fit is not whole,
    )


def make_diagnosis(
    record: Dataset,
    outcome: SearchOutcome,
    base: CalibrationResult,
    terms: MissingTerms | None,
    run: DiagnosisRun,
) -> Diagnosis:
    """Measure the gain on the hold-out part, describe the effects and detect properties of the noise.

    The base of ``outcome`` may be calibrated to whitened residuals; ``base`` is calibrated to unweighted
    ones. Missing terms, if there are any, are an alternative of a single effect.
    """
    verdict, floor, target = outcome.verdict, outcome.noise_floor, outcome.target
    fitted = target.fitted
    base = fit_initial_states(base, target, fitted)
    hypothesis = replace(outcome.hypothesis, fit=fit_initial_states(outcome.hypothesis.fit, target, fitted))
    holdout = slice(fitted, record.samples)
    gain, best = None, hypothesis.fit
    if verdict in (Verdict.NAMED, Verdict.REMAINDER, Verdict.FAMILY):
        best = leave_out_contradicted_time(record, best, target, run.rng)
        confirmed = replace(outcome, hypothesis=hypothesis.with_fit(best))
        gain = _measure_confirmed_gain(confirmed, base, record, run.rng)
        if gain is None:  # There is a discrepancy, but its cause is another.
            verdict = Verdict.UNKNOWN
    findings: tuple[Finding, ...] = ()
    equivalents: tuple[ScreenedEffect, ...] = ()
    if gain is not None:
        rival = None if terms is None else terms.rival
        fitted_outcome = replace(outcome, hypothesis=hypothesis)
        findings, equivalents = describe_effects(fitted_outcome, run, rival)
        if verdict == Verdict.REMAINDER:
            findings = (findings[0], *(replace(each, is_claimed=False) for each in findings[1:]))
        findings = tuple(map(_withdraw_improbable, findings))
        if not any(each.is_claimed for each in findings):
            findings, equivalents, gain, verdict = (), (), None, Verdict.UNKNOWN
    residual = (record.y - hypothesis.fit.output)[:fitted]
    context = hypothesis.fit.simulation.context
    is_explained = verdict not in (Verdict.UNKNOWN, Verdict.STOPPED)
    noise = describe_noise(record.y[:fitted], residual, context) if is_explained else ()
    as_given = evaluate_fit(base.simulation, target, base.simulation.nominal)
    # The first recording begins as the simulation states.
    nominal = fit_initial_states(as_given, target, 1).output
    return Diagnosis(
        verdict,
        (*findings, *noise),
        tuple(
            Candidate(
                each.effect.cause,
                each.score_gain(outcome.base),
                explained_fraction(outcome.base, each.fit, floor),
                each.effect.place,
            )
            for each in outcome.screened
            if not each.effect.is_free or each.effect in hypothesis.effects
        ),
        gain,
        outcome.residual_structure,
        design_next_experiment(record, hypothesis.fit, equivalents, target, run.parallel_map),
        record,
        fitted,
        base,
        best if findings else base,
        floor**0.5,
        outcome.is_noise_floor_measured,
        compute_rmse((record.y - nominal)[holdout]),
        discovery=terms.discovery if terms is not None and _is_equivalent(findings) else None,
        shape=compare_shapes(replace(outcome, hypothesis=hypothesis)) if findings else None,
        is_time_left_out=bool(findings) and best is not hypothesis.fit,
    )


def _withdraw_improbable(finding: Finding) -> Finding:
    """Return a finding that is not claimed if others are much more probable."""
    return replace(finding, is_claimed=finding.is_claimed and finding.confidence >= MIN_CONFIDENCE)


def _measure_confirmed_gain(
    outcome: SearchOutcome, base: CalibrationResult, record: Dataset, rng: np.random.Generator
) -> HoldoutGain | None:
    """Return the gain of the effects of an outcome on the hold-out part; None if that refutes them."""
    hypothesis, target = outcome.hypothesis, outcome.target
    holdout = slice(target.fitted, record.samples)
    reference = choose_reference_fit(hypothesis.effects, base, target)
    before = fit_initial_states(reference, target, target.fitted).output
    gain = measure_gain(record, before, hypothesis.fit.output, holdout, outcome.noise_floor**0.5, rng)
    # Under model error, a gain in the estimation part is no evidence of one in another part.
    is_confirmed = (
        bound_gain(gain, before, hypothesis.fit, target, rng) >= -MAX_HOLDOUT_LOSS_PERCENT
        if target.effective_samples is None
        else gain.ci95[0] > 0.0
    )
    return gain if is_confirmed else None


def _is_equivalent(findings: Sequence[Finding]) -> bool:
    """Return whether missing terms explain the record as well as an effect."""
    return any(MISSING_TERM in each.equivalents for each in findings)
