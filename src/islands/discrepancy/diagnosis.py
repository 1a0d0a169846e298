"""Diagnosis of a simulation on a record: discrepancies, their causes, and the gain of modelling them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.initial_states import fit_initial_states
from islands.discrepancy.calibration.intersample_selection import same_discretisation, select_intersample
from islands.discrepancy.calibration.levenberg_marquardt import (
    CalibrationResult,
    Target,
    calibrate,
    evaluate_fit,
)
from islands.discrepancy.calibration.preparation import (
    count_fitted_samples,
    make_context,
    make_target,
    select_effects,
    validate_prior,
)
from islands.discrepancy.diagnosis_result import Candidate, Diagnosis
from islands.discrepancy.discovery.discovery import Discovery, describe_terms, discover_terms
from islands.discrepancy.discovery.form_search import compare_with_free_forms
from islands.discrepancy.discovery.term_search import TermSearchResult
from islands.discrepancy.effects import EFFECTS
from islands.discrepancy.findings import describe_gross_errors, describe_noise, list_record_findings
from islands.discrepancy.gross_errors.channel_admission import admit_channels
from islands.discrepancy.gross_errors.closed_loop import find_closed_loop
from islands.discrepancy.gross_errors.gross_error import GrossError
from islands.discrepancy.gross_errors.gross_error_search import explain_divergence, find_gross_errors
from islands.discrepancy.gross_errors.record_finding import describe_gaps
from islands.discrepancy.inference.experiment_design import suggest_experiment
from islands.discrepancy.inference.finding import Finding, describe_effects
from islands.discrepancy.inference.holdout import compute_rmse, measure_gain
from islands.discrepancy.inference.residual_structure import find_residual_structure
from islands.discrepancy.inference.screening import ScreenedEffect, screen_effects
from islands.discrepancy.inference.strategies import (
    SearchOutcome,
    assess_evidence,
    best_single,
    search_with_ar_noise,
    search_with_model_error,
)
from islands.discrepancy.inference.verdict import Verdict, choose_reference_fit, classify, explained_fraction
from islands.discrepancy.interfaces.effect import Effect
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.discrepancy.interfaces.simulator import Simulator, get_tolerances
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.errors import RecordError
from islands.evolution.progress import ProgressCallback, ignore_progress

#: Maximum number of searches, one after each change of the intersample behaviour or the step size.
MAX_ROUNDS = 3

#: Effects are rejected if they increase the RMSE of the hold-out part by more than this percentage, with a
#: certainty of 97.5 %. It is not zero, since an effect that calibration absorbs changes the RMSE by almost
#: nothing in either direction.
MAX_HOLDOUT_LOSS_PERCENT = 0.5


def diagnose(
    record: Dataset,
    simulator: Simulator,
    tolerance: Mapping[str, float] | None = None,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    parallel_map: ParallelMap = map,
    catalogue: Sequence[Effect] = EFFECTS,
) -> Diagnosis:
    """Diagnose a simulation on a record.

    Parameters
    ----------
    record : Dataset
        Measured record. Its first input drives the simulation; further inputs are channels that may couple
        in. Each of several recordings has its own initial states; all other parameters are common to them.
    simulator : Simulator
    tolerance : mapping, optional
        Relative standard deviations of the simulator's parameters about their nominal values, in addition to
        those that the simulator states. Other parameters are free: a misfit that calibrating them removes is
        no discrepancy.
    seed : int
        Seed of the random generator.
    progress : ProgressCallback
        Takes a message at the start of each step, and the fraction of a typical diagnosis before it. It
        decreases if a search is repeated.
    parallel_map : ParallelMap
        Calibrates the effects. The result does not depend on it.
    catalogue : sequence of Effect
        The effects that are searched for, and the free forms that they are compared with.

    Raises
    ------
    RecordError
        The record or one of its recordings is too short, or has too few outputs or a constant one, or the
        simulation diverges on it.
    SettingsError
        A tolerance is not between 0 and 1 or belongs to no parameter of the simulator, two effects have the
        same name, or an effect is invalid.
    """
    prior_std = validate_prior({**get_tolerances(simulator), **(tolerance or {})}, simulator)
    fitted = count_fitted_samples(record)
    record, record_findings = admit_channels(record, fitted)
    record_findings += describe_gaps(record)
    try:
        context = make_context(record, simulator, fitted)
    except RecordError as error:
        raise explain_divergence(error, record, simulator, fitted, prior_std) from error
    rng = np.random.default_rng(seed)
    simulation = ExtendedSimulator(simulator, (), context)
    target = make_target(record, fitted, prior_std)
    progress("calibrating the simulation", 0.0)
    base = calibrate(simulation, target, simulation.nominal)
    progress("looking for gross errors of the record", 0.01)
    if gross_errors := find_gross_errors(record, simulator, base, fitted, prior_std):
        found = _make_gross_diagnosis(record, base, gross_errors, fitted)
        return replace(found, record_findings=(*found.record_findings, *record_findings))
    simulator = select_intersample(base, target)
    effects = select_effects(simulator, context, prior_std, catalogue)
    for _ in range(MAX_ROUNDS):
        base = calibrate(replace(simulation, simulator=simulator), target, base.values)
        progress(f"screening {len(effects)} effects", 0.02)
        screened = screen_effects(base, target, effects, parallel_map)
        selected = select_intersample(best_single(base, screened), target)
        if same_discretisation(selected, simulator):
            outcome = search_with_ar_noise(base, screened, target, effects, progress, parallel_map)
            selected = select_intersample(outcome.hypothesis.fit, outcome.target)
        if same_discretisation(selected, simulator):
            break
        # The missing effect had hidden that another intersample behaviour or a finer step fits better.
        progress("intersample behaviour changed: repeating the search")
        simulator = selected
    else:
        outcome = search_with_ar_noise(base, screened, target, effects, progress, parallel_map)
    progress("analysing the residual", 0.9)
    outcome = assess_evidence(outcome, fitted, effects, rng)
    if outcome.verdict == Verdict.UNKNOWN or (
        outcome.verdict == Verdict.NOTHING and outcome.hypothesis.fit.noise.order
    ):
        model_error = search_with_model_error(base, target, effects, progress, parallel_map)
        second = assess_evidence(model_error, fitted, effects, rng)
        outcome = second if second.verdict != Verdict.UNKNOWN else outcome
    if outcome.verdict != Verdict.NOTHING:
        progress("comparing with free forms", 0.9)
        forms = select_effects(simulator, context, prior_std, catalogue, free=True)
        outcome = compare_with_free_forms(outcome, forms, fitted, (*effects, *forms), rng, parallel_map)
        effects = [*effects, *(form for form in forms if form in outcome.hypothesis.effects)]
    found = _make_diagnosis(record, outcome, base, effects, fitted, rng, progress, parallel_map)
    if outcome.verdict != Verdict.NOTHING or outcome.hypothesis.fit.noise.order:
        progress("searching for missing terms", 0.95)
        discovered = discover_terms(base, outcome.hypothesis, outcome.screened, target, fitted, rng)
        if discovered is not None:
            found = _extend_equations(found, *discovered, target, rng)
    closed_loop = find_closed_loop(found.best, record.y, fitted, record.input_names[0])
    return replace(found, record_findings=(*record_findings, *closed_loop))


def _make_gross_diagnosis(
    record: Dataset, base: CalibrationResult, errors: Sequence[GrossError], fitted: int
) -> Diagnosis:
    """Describe gross errors. No effects are searched for; the best fit is that of the corrected record."""
    best = errors[0]
    return Diagnosis(
        verdict=Verdict.GROSS_ERROR,
        effects=describe_gross_errors(errors),
        candidates=(),
        gain=None,
        residual_structure={},
        suggested_experiment="",
        record=record,
        estimation_samples=fitted,
        base=base,
        best=best.fit_of_record or base,
        noise_floor=best.rmse,
        is_noise_floor_measured=False,
        nominal_rmse=compute_rmse((record.y - base.output)[fitted:]),
        record_findings=list_record_findings(errors),
    )


def _extend_equations(
    found: Diagnosis,
    search: TermSearchResult,
    discovery: Discovery,
    target: Target,
    rng: np.random.Generator,
) -> Diagnosis:
    """Return the diagnosis with discovered terms in place of effects, if the hold-out part confirms them.

    Its error has to be smaller with them than without, and not larger than with the effects. The terms have
    to explain as much as effects would have to.
    """
    record, fitted = found.record, found.estimation_samples
    fit = fit_initial_states(search.fit, target, fitted)
    holdout = slice(fitted, record.samples)
    floor = min(found.noise_floor, float(np.sqrt(fit.mean_square)))
    gain = measure_gain(record, found.base.output, fit.output, holdout, floor, rng)
    if gain.ci95[0] <= 0.0 or (found.gain is not None and gain.after.rmse > found.gain.after.rmse):
        return found
    residual, output = (record.y - fit.output)[:fitted], fit.output[:fitted]
    context = fit.simulation.context
    structure = find_residual_structure(residual, output, context, rng)
    if structure:  # The rest is no noise: only its innovations are.
        floor = min(floor, float(np.sqrt(fit.noise.variance)))
    explained = explained_fraction(found.base, fit, floor**2)
    if (
        classify(explained, has_effects=True, has_remainder=bool(structure), is_model_error=False)
        == Verdict.UNKNOWN
    ):
        return found
    return replace(
        found,
        verdict=Verdict.DISCOVERED,
        effects=(
            *describe_terms(replace(search, fit=fit), discovery, found.base, target, floor**2),
            *describe_noise(record.y[:fitted], residual, context),
        ),
        gain=gain,
        residual_structure=structure,
        suggested_experiment="",
        best=fit,
        noise_floor=floor,
        discovery=discovery,
    )


def _make_diagnosis(
    record: Dataset,
    outcome: SearchOutcome,
    base: CalibrationResult,
    effects: Sequence[Effect],
    fitted: int,
    rng: np.random.Generator,
    progress: ProgressCallback,
    parallel_map: ParallelMap,
) -> Diagnosis:
    """Measure the gain on the hold-out part, describe the effects and detect properties of the noise.

    The base of ``outcome`` may be calibrated to whitened residuals; ``base`` is calibrated to unweighted
    ones.
    """
    verdict, floor, target = outcome.verdict, outcome.noise_floor, outcome.target
    base = fit_initial_states(base, target, fitted)
    hypothesis = replace(outcome.hypothesis, fit=fit_initial_states(outcome.hypothesis.fit, target, fitted))
    holdout = slice(fitted, record.samples)
    gain = None
    if verdict in (Verdict.NAMED, Verdict.REMAINDER, Verdict.FAMILY):
        reference = choose_reference_fit(hypothesis, base, target)
        before = fit_initial_states(reference, target, fitted).output
        gain = measure_gain(record, before, hypothesis.fit.output, holdout, floor**0.5, rng)
        # Under model error, a gain in the estimation part is no evidence of one in another part.
        is_confirmed = (
            gain.ci95[1] >= -MAX_HOLDOUT_LOSS_PERCENT
            if target.effective_samples is None
            else gain.ci95[0] > 0.0
        )
        if hypothesis.effects and not is_confirmed:
            # There is a discrepancy, but its cause is another.
            gain, verdict = None, Verdict.UNKNOWN
    findings: tuple[Finding, ...] = ()
    equivalents: tuple[ScreenedEffect, ...] = ()
    if gain is not None:
        progress("screening alternative causes", 0.92)
        findings, equivalents = describe_effects(
            hypothesis, outcome.base, outcome.screened, target, effects, floor, parallel_map
        )
    residual = (record.y - hypothesis.fit.output)[:fitted]
    context = hypothesis.fit.simulation.context
    noise = describe_noise(record.y[:fitted], residual, context) if verdict != Verdict.UNKNOWN else ()
    as_given = evaluate_fit(base.simulation, target, base.simulation.nominal)
    nominal = fit_initial_states(as_given, target, 0).output
    return Diagnosis(
        Verdict.NAMED if noise and verdict == Verdict.NOTHING else verdict,
        (*findings, *noise),
        tuple(
            Candidate(
                each.effect.cause,
                each.score_gain(outcome.base),
                explained_fraction(outcome.base, each.fit, floor),
            )
            for each in outcome.screened
            if not each.effect.is_free or each.effect in hypothesis.effects
        ),
        gain,
        outcome.residual_structure,
        suggest_experiment(hypothesis.fit, equivalents),
        record,
        fitted,
        base,
        hypothesis.fit if findings else base,
        floor**0.5,
        outcome.is_noise_floor_measured,
        compute_rmse((record.y - nominal)[holdout]),
    )
