"""Diagnosis of a simulation on a record: discrepancies, their causes, and the gain of modelling them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from islands.diagnosis.assembly import extend_equations, make_diagnosis, make_gross_diagnosis
from islands.diagnosis.calibration.intersample_selection import (
    Discretisation,
    get_discretisation,
    select_intersample,
)
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.preparation import (
    count_fitted_samples,
    make_target,
    select_effects,
    validate_prior,
)
from islands.diagnosis.calibration.smoothing_widths import narrow_friction, narrow_steps
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.equation_simulator import find_equations
from islands.diagnosis.discovery.form_search import compare_with_free_forms
from islands.diagnosis.discovery.inner_effects import list_effects, search_inner_effects
from islands.diagnosis.discovery.missing_terms import (
    TermSearches,
    compare_terms,
    explain_all,
    find_missing_terms,
    replaces_effects,
)
from islands.diagnosis.discovery.replaced_terms import search_instead_of_terms
from islands.diagnosis.gross_errors.channel_admission import admit_channels
from islands.diagnosis.gross_errors.record_finding import describe_extrapolation, describe_gaps
from islands.diagnosis.gross_errors.search import explain_divergence, find_gross_errors
from islands.diagnosis.inference.direct_feedback import hold_direct_term, list_late_effects
from islands.diagnosis.inference.exchanged_parts import exchange_parts
from islands.diagnosis.inference.extension_trial import refine_extension
from islands.diagnosis.inference.screening import screen_effects
from islands.diagnosis.inference.strategies import (
    WITH_MODEL_ERROR,
    SearchOutcome,
    assess_evidence,
    best_single,
    make_exact_outcome,
    search_with_ar_noise,
    search_with_model_error,
)
from islands.diagnosis.inference.time_functions import with_held_out_output
from islands.diagnosis.inference.timing_alternatives import add_timing_alternatives, find_timing_simulator
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.interim_findings import (
    EVIDENCE,
    FREE_FORMS,
    MISSING_TERMS,
    MODEL_ERROR,
    InterimFindings,
)
from islands.diagnosis.noise_claim import complete_findings
from islands.diagnosis.result import Diagnosis
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import EFFECTS
from islands.effects.interface.effect import Effect
from islands.errors import IslandsError, RecordError
from islands.parallel import ParallelMap
from islands.progress import AnswerFoundError, Phase, PhasedProgress, ProgressCallback, ignore_progress
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator
from islands.simulators.output_equation import add_output_equation

#: Maximum number of intersample behaviours and step sizes with which effects are searched for.
MAX_SEARCHES = 3

#: Phase of a search whose outcome is known before missing terms are searched for.
_MODEL_ERROR = "the residual is model error"

#: Phases of a diagnosis. The shares and steps are those with which the times left are least wrong in six
#: diagnoses that `lab/searches/phase_shares.py` records: a process with a squared input (3000 samples), one
#: with a saturating input as ``linear:2`` and as ``second-order`` (1500), one with a limit of a state (1500),
#: a short record (500), and a stiff spring (3000). Missing terms are searched for with effects as well,
#: unless the residual is model error. That is known after the search inside of a linear simulation, which
#: belongs to the analysis of the residual.
PHASES = (
    Phase("calibrating the simulation", 0.002),
    Phase("looking for gross errors", 0.018),
    Phase("screening each of", 0.017, 3),
    Phase("the noise is coloured", 0.033, 5),
    Phase("effects in addition", 0.120, 14),
    Phase("screening alternative causes", 0.006, 33),
    Phase("analysing the residual", 0.053, 6),
    Phase(_MODEL_ERROR, 0.041),
    Phase(f"{WITH_MODEL_ERROR}effects in addition", 0.343, 35),
    Phase(f"{WITH_MODEL_ERROR}screening alternative causes", 0.236, 60),
    Phase("comparing with free forms", 0.060, 30),
    Phase("searching for missing terms", 0.072, 25, unless=_MODEL_ERROR),
    Phase("searching for missing terms", 0.047, 6),
    Phase("alternatives to the named causes", 0.025, 4),
)

#: Fraction from which the time left of a diagnosis is estimated: the phases that follow are known, and the
#: first ones, whose times differ most, weigh little. In six recorded diagnoses of 5 to 29 s, estimates were
#: wrong by at most half of the truth and 3 s, and never below 0.6 of more than 15 s.
LEAST_FRACTION = 0.25


def diagnose(
    record: Dataset,
    simulator: Simulator,
    tolerance: Mapping[str, float] | None = None,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    parallel_map: ParallelMap = map,
    catalogue: Sequence[Effect] = EFFECTS,
    interim: InterimFindings | None = None,
    noise_level: float | None = None,
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
    interim : InterimFindings, optional
        Receives what is found on the way.
    noise_level : float, optional
        Standard deviation of the noise of the output, in its unit. A residual far above it is no noise.

    Raises
    ------
    RecordError
        The record or one of its recordings is too short, or has too few outputs or a constant one, or the
        simulation diverges on it.
    SettingsError
        A tolerance is not between 0 and 1 or belongs to no parameter of the simulator, two
        effects have the same name, or an effect is invalid.
    """
    interim = interim or InterimFindings()
    prior_std = validate_prior({**simulator.tolerances, **(tolerance or {})}, simulator)
    fitted = count_fitted_samples(record)
    record, record_findings = admit_channels(record, fitted, simulator.read_channels)
    record_findings += (*describe_gaps(record), *describe_extrapolation(record, simulator))
    target = make_target(record, fitted, prior_std)
    try:
        context = make_context(record, simulator, fitted)
    except RecordError as error:
        raise explain_divergence(error, record, simulator, target) from error
    run = _start_run(seed, parallel_map, progress)
    if find_equations(simulator) is None:
        simulator = add_output_equation(simulator, context)
    simulation = ExtendedSimulator(simulator, (), context)
    run.progress("calibrating the simulation")
    base = calibrate(simulation, target, simulation.nominal)
    interim.begin(record, base, target, record_findings, noise_level)
    run.progress("looking for gross errors of the record")
    if gross_errors := find_gross_errors(record, simulator, base, target):
        found = make_gross_diagnosis(record, base, gross_errors, target)
        return interim.complete(replace(found, record_findings=(*found.record_findings, *record_findings)))
    held = hold_direct_term(base, target)
    if held is not None:
        base, target, simulator = held, replace(target, has_feedback=True), held.simulation.simulator
        interim.begin(record, base, target, record_findings, noise_level)
    effects, forms = (
        list_late_effects(each, base) if target.has_feedback else each
        for each in (select_effects(simulator, context, prior_std, catalogue, free) for free in (False, True))
    )
    try:
        found = _find_causes(record, base, target, run.with_effects(effects), forms, interim, seed)
        found = complete_findings(found, held or found.best, target, record_findings, noise_level, run.rng)
    except AnswerFoundError as ended:
        found = interim.fail(ended, seed) or ended.found
    except (IslandsError, OSError, MemoryError):
        raise  # of the caller, or of the machine: the diagnosis may succeed if it is repeated
    except Exception as error:
        failed = interim.fail(error, seed)
        if failed is None:
            raise
        found = failed
    return interim.complete(found)


def _find_causes(
    record: Dataset,
    base: CalibrationResult,
    target: Target,
    run: DiagnosisRun,
    forms: Sequence[Effect],
    interim: InterimFindings,
    seed: int,
) -> Diagnosis:
    """Search for effects, and compare them with free forms and missing terms."""
    base, outcome = _search(base, target, run, interim)
    if target.is_matched(base.output):
        return make_diagnosis(record, outcome, base, None, run)
    interim.reach(EVIDENCE)
    run.progress("analysing the residual")
    outcome = interim.keep_outcome(base, assess_evidence(outcome, run), run.effects, step=MODEL_ERROR)
    # Coloured noise may hide a discrepancy that no effect of the catalogue explains.
    is_white = outcome.verdict == Verdict.NOTHING and not outcome.hypothesis.fit.noise.order
    inner = search_inner_effects(outcome, base, target, run, is_white=is_white)
    is_clean = is_white and inner is outcome
    searches = TermSearches(base, target, run)
    if not inner.leaves_white_noise:
        is_noise = outcome.verdict == Verdict.NOTHING and not is_clean
        is_open = is_noise or outcome.verdict == Verdict.UNKNOWN
        if is_open and not explain_all(searches, seed, is_noise):
            second = assess_evidence(search_with_model_error(base, target, run), run)
            if second.verdict != Verdict.UNKNOWN:
                outcome, inner = second, search_inner_effects(second, base, target, run)
    interim.keep_outcome(base, outcome, run.effects, step=FREE_FORMS)
    if not is_clean:
        if inner is not outcome:
            base, outcome = calibrate(inner.base.simulation, target, inner.base.values), inner
            found_effects = outcome.hypothesis.effects
            run = run.with_effects(list_effects(base.simulation.simulator, run, found_effects))
            searches = TermSearches(base, target, run)
        run.progress("comparing with free forms")
        outcome = compare_with_free_forms(outcome, forms, run)
        found_forms = [form for form in forms if form in outcome.hypothesis.effects]
        run = run.with_effects([*run.effects, *found_forms])
    interim.keep_outcome(base, outcome, run.effects, step=MISSING_TERMS)
    run.progress("searching for missing terms")
    terms = None if is_clean else find_missing_terms(searches, outcome, run)
    if terms and (again := search_instead_of_terms(terms, outcome, base, target, run)) is not outcome:
        base, outcome = calibrate(again.base.simulation, target, again.base.values), again
        terms = compare_terms(terms, outcome, base, target)
        interim.keep_outcome(base, outcome, run.effects, step=MISSING_TERMS)
    interim.keep_terms(terms)
    run.progress("alternatives to the named causes")
    outcome = add_timing_alternatives(outcome, run)
    found = interim.keep_diagnosis(make_diagnosis(record, outcome, base, terms, run))
    if terms is not None and replaces_effects(terms, base, outcome, target, run.rng):
        found = extend_equations(found, terms, target, run)
    if found.gain is None:
        return found
    # An extension that diverges beyond its record is not offered.
    best, trial = refine_extension(record, base, found.best, target)
    if found.is_time_left_out:
        best = with_held_out_output(best, found.best, target.fitted)
    exchange = exchange_parts(record, found.base, best, target, found.noise_floor, run.rng)
    return replace(found, best=best, trial=trial, exchange=exchange)


def _start_run(seed: int, parallel_map: ParallelMap, progress: ProgressCallback) -> DiagnosisRun:
    phased = PhasedProgress(progress, PHASES)
    return DiagnosisRun((), np.random.default_rng(seed), phased.count(parallel_map), phased)


def _calibrate_again(
    simulation: ExtendedSimulator, target: Target, fit: CalibrationResult
) -> CalibrationResult:
    """Calibrate a simulation with another step from the values of a fit, or from the nominal ones.

    With a larger step it may diverge at the values of the smaller one.
    """
    found = calibrate(simulation, target, fit.values)
    return found if np.isfinite(found.mean_square) else calibrate(simulation, target, simulation.nominal)


def _search(
    base: CalibrationResult, target: Target, run: DiagnosisRun, interim: InterimFindings
) -> tuple[CalibrationResult, SearchOutcome]:
    """Search with the widths of dry friction and of steps over time that suit the record.

    Returns
    -------
    CalibrationResult
        The simulation without effects, calibrated to unweighted residuals.
    SearchOutcome
    """
    while True:
        base, outcome = _search_with_steps(base, target, run, interim)
        fit = outcome.hypothesis.fit
        context = narrow_friction(fit, outcome.target)
        if context is fit.simulation.context:
            narrower = narrow_steps(fit, outcome.target)
            return base, outcome if narrower is fit else outcome.with_fit(narrower)
        run.progress("dry friction is narrower: repeating the search")
        base = replace(base, simulation=replace(base.simulation, context=context))


def _search_with_steps(
    base: CalibrationResult, target: Target, run: DiagnosisRun, interim: InterimFindings
) -> tuple[CalibrationResult, SearchOutcome]:
    """Search with the intersample behaviour and the step that suit all effects; see `_search`."""
    simulation, simulator = base.simulation, select_intersample(base, target)
    tried: set[Discretisation] = set()
    found: dict[Discretisation, tuple[CalibrationResult, SearchOutcome]] = {}
    confirmed = []
    while True:
        current = get_discretisation(simulator)
        tried.add(current)
        base = _calibrate_again(replace(simulation, simulator=simulator), target, base)
        if target.is_matched(base.output):
            return base, make_exact_outcome(base, target)
        run.progress(f"screening each of {len(run.effects)} effects")
        recorded = replace(run, parallel_map=interim.record_screening(base, run.parallel_map))
        screened = screen_effects(base, target, recorded)
        interim.keep_screening(base, screened)
        # What suits all effects is kept: next to one of them, the others look like its errors.
        selected = simulator if found else select_intersample(best_single(base, screened), target)
        if len(tried) == MAX_SEARCHES or get_discretisation(selected) in tried:
            outcome = search_with_ar_noise(base, screened, target, run)
            found[current] = base, outcome
            selected = select_intersample(outcome.hypothesis.fit, outcome.target)
            if get_discretisation(selected) == current:
                confirmed.append(found[current])
                selected = find_timing_simulator(outcome.hypothesis, outcome.target, run) or simulator
            if get_discretisation(selected) in found or len(found) == MAX_SEARCHES:
                return min(confirmed or found.values(), key=lambda each: each[1].hypothesis.rank)
        # The missing effect had hidden that another intersample behaviour or a finer step fits better.
        run.progress("intersample behaviour changed: repeating the search")
        simulator = selected
