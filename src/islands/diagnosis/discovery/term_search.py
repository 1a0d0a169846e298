"""Search for terms that the equations of a simulation lack.

Each candidate term is simulated in its equation. Its response to a small coefficient, without the part that
the other parameters reproduce, says how much of the residual it explains: forward selection by the error
reduction ratio (Billings, Nonlinear System Identification, section 3), with responses instead of regressors.
The most promising terms are then fitted with all parameters by the Levenberg-Marquardt method.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np

from islands.diagnosis.calibration.intersample_selection import get_discretisation, select_intersample
from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    estimate_covariance,
    whiten_target,
)
from islands.diagnosis.calibration.pattern_search import Coordinate, search_pattern
from islands.diagnosis.calibration.starts_calibrator import StartsCalibrator, calibrate_all
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.candidate_terms import (
    STARTING_SCALES,
    CandidateTerm,
    acts_on_output,
    find_free_numbers,
    list_candidate_terms,
    list_gated_terms,
    name_equation,
    shifts_in_time,
    vary_gate,
)
from islands.diagnosis.discovery.equation_simulator import (
    add_terms,
    find_equations,
    find_used_names,
    get_system,
    with_equations,
)
from islands.diagnosis.discovery.redundant_terms import drop_redundant_terms
from islands.diagnosis.discovery.term_ranking import RankedTerm, rank_terms
from islands.diagnosis.inference.finding import EQUIVALENCE_MARGIN
from islands.diagnosis.inference.resolved_effects import may_be_zero
from islands.diagnosis.inference.screening import (
    bic_penalty,
    extend,
    get_starting_points,
    transfer_parameters,
)
from islands.diagnosis.inference.stepwise_search import MIN_GAIN
from islands.diagnosis.run import DiagnosisRun
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect
from islands.effects.timing import DELAY
from islands.expressions.primitives import DIV, EQUATION_FUNCTIONS
from islands.expressions.printing import render
from islands.expressions.tree import Apply, Constant, Expression, Symbol
from islands.expressions.tree import replace as replace_parts
from islands.records.segments import fill_gaps
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import peak_amplitude
from islands.simulators.ode.system import OUTPUT, OdeSystem
from islands.simulators.ode.system_document import SYMBOL_MEANINGS

#: Maximum number of terms.
MAX_TERMS = 3

#: Number of terms of each step that are fitted with all parameters.
FITTED_TERMS = 12

#: Number of terms with a gate in time of each step that are fitted with all parameters.
FITTED_GATES = 4

#: Part of the required gain that the responses to a term have to promise, so that it is fitted. In the steps
#: of nine diagnoses, terms that gained enough promised 0.6 of it or more.
MIN_PROMISE = 1.0 / 3.0

#: Number of times that the distance between the instants of a gate is halved before it is fitted.
_GATE_HALVINGS = 6

#: Width of a smooth sign of a state, relative to its largest value.
_SMOOTHING = 0.02

#: Ratio of the gains of a term and of the one before that is expected at most. Of terms that act together,
#: the second one may gain more than the first.
MAX_GAIN_RATIO = 2.0


@dataclass(frozen=True, slots=True)
class DiscoveredTerm:
    """A term that has been added to an equation.

    Attributes
    ----------
    term : CandidateTerm
    number : int
        Number of the term in the names of its parameters.
    gain : float
        Decrease of minus twice the log-likelihood when it was added, less the penalty.
    penalty : float
        BIC penalty of its values, and the logarithm of the number of terms that could gain by chance.
    """

    term: CandidateTerm
    number: int
    gain: float
    penalty: float

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its parameters in the equations: the coefficient, and the scale if there is one."""
        return self.term.name_parameters(self.number)

    def describe(self) -> str:
        """Return the term with its equation, as ``a1*(x*v) in dv/dt``."""
        return self.term.describe(self.number)


@dataclass(frozen=True, slots=True, eq=False)
class TermSearchResult:
    """Equations with the terms that a search has added.

    Attributes
    ----------
    base : CalibrationResult
        The simulation without the terms. It may have effects.
    fit : CalibrationResult
    terms : tuple of DiscoveredTerm
        In the order in which they were found.
    """

    base: CalibrationResult
    fit: CalibrationResult
    terms: tuple[DiscoveredTerm, ...]

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects of the simulation."""
        return self.fit.simulation.effects

    @property
    def cost(self) -> float:
        """Score of the fit plus the penalties of its terms and effects; less is better."""
        effects = sum(bic_penalty(effect, self.fit) for effect in self.effects)
        return self.fit.score + sum(each.penalty for each in self.terms) + effects

    @property
    def gain(self) -> float:
        """Score gain of the terms in minus twice the log-likelihood, less their penalties."""
        return self.base.score - self.fit.score - sum(each.penalty for each in self.terms)

    def describe(self) -> str:
        """Return the extended equations and the values of their new parameters as one line."""
        system = get_system(self.fit)
        right_sides = {**dict(system.derivatives), OUTPUT: system.output}
        changed = dict.fromkeys(each.term.target for each in self.terms)
        if not isinstance(system.output, Symbol):
            changed[OUTPUT] = None
        lines = [f"{name_equation(target)} = {render(right_sides[target])}" for target in changed]
        values = {
            parameter.name: f"{parameter.name} = {value:.4g} {parameter.unit}".rstrip()
            for parameter, value in zip(self.fit.simulation.parameters, self.fit.values, strict=True)
        }
        new = [values[name] for each in self.terms for name in each.parameters]
        return "; ".join([*lines, ", ".join(new), *([SYMBOL_MEANINGS] if system.simulated else [])])


def search_terms(
    base: CalibrationResult,
    target: Target,
    run: DiagnosisRun,
    least: float = np.inf,
    start: TermSearchResult | None = None,
    max_terms: int = MAX_TERMS,
) -> TermSearchResult | None:
    """Add terms to the equations of a simulation as long as each gains more than any would by chance.

    Parameters
    ----------
    base : CalibrationResult
        The calibrated simulation. It keeps its effects.
    target : Target
    run : DiagnosisRun
    least : float
        Cost of another explanation. The search ends if further terms are not expected to reach it.
    start : TermSearchResult, optional
        Result of a search with fewer terms, which is continued.
    max_terms : int
        Maximum number of terms.

    Returns
    -------
    TermSearchResult or None
        None if no term gains enough.
    """
    equations = find_equations(base.simulation.simulator)
    assert equations is not None
    context = base.simulation.context
    system = equations.system
    rate = peak_amplitude(context.take_differences(context.u)) / context.dt
    sizes = {**equations.sizes, system.input: context.input_peak, f"rate({system.input})": rate}
    units = {each.name: each.unit for each in system.states}
    units |= {system.input: context.input_unit, OUTPUT: context.output_unit}
    units |= dict.fromkeys(system.simulated, context.output_unit)
    candidates = list_candidate_terms(system, sizes, context.duration, units)
    if target.has_feedback:
        candidates = tuple(each for each in candidates if not acts_on_output(each, system.input))
    if run.has_inner_terms_only:
        candidates = tuple(each for each in candidates if each.target != OUTPUT)
    target_sizes = {
        OUTPUT: context.output_peak,
        **{name: sizes[f"d{name}/dt"] for name, _ in system.derivatives},
    }
    found, unweighted = start or TermSearchResult(base, base, ()), target
    while len(found.terms) < max_terms and not target.is_matched(found.fit.output):
        target = whiten_target(target, found.fit)
        found = _improve(found, calibrate(found.fit.simulation, target, found.fit.values))
        best = _find_best_term(found, target, unweighted, candidates, target_sizes, run)
        if best is None or best.cost > found.cost - MIN_GAIN:
            break
        before = found.cost
        best = _select_discretisation(best, target)
        best = _eliminate_terms(best, system, target, target_sizes, run)
        best = _improve(best, _calibrate_smoothed(best.fit, target, equations.sizes))
        best = _take_limits(best, system, target, target_sizes, candidates, equations.sizes)
        best = _move_instants(best, target)
        best = _correct_timing(best, system, target, target_sizes, run)
        if best.cost > before - MIN_GAIN or _may_lack_a_term(best, target):
            break
        found = best
        missing = max_terms - len(found.terms)
        if found.cost - missing * MAX_GAIN_RATIO * (before - found.cost) > least:
            break
    return found if found.terms else None


def _improve(found: TermSearchResult, fit: CalibrationResult) -> TermSearchResult:
    """Return the equations with another fit, if that is better."""
    return replace(found, fit=fit) if fit.score < found.fit.score else found


def _calibrate_smoothed(
    fit: CalibrationResult, target: Target, sizes: Mapping[str, float]
) -> CalibrationResult:
    """Calibrate equations from the values of the same equations with smooth signs of states.

    The output is no smooth function of the parameters if the sign of a state changes within a step, so that a
    calibration may end too early.

    Parameters
    ----------
    sizes : mapping
        Largest absolute values of the states.
    """
    system = get_system(fit)

    def smooth(part: Expression) -> Expression | None:
        match part:
            case Apply(primitive, (Symbol(name),)) if primitive.name == "sign" and name in sizes:
                width = Constant(_SMOOTHING * sizes[name])
                return Apply(EQUATION_FUNCTIONS["tanh"], (Apply(DIV, (Symbol(name), width)),))
        return None

    derivatives = tuple((name, replace_parts(right, smooth)) for name, right in system.derivatives)
    if derivatives == system.derivatives:
        return fit
    simulator = with_equations(fit.simulation.simulator, replace(system, derivatives=derivatives))
    smoothed = calibrate(replace(fit.simulation, simulator=simulator), target, fit.values)
    return calibrate(fit.simulation, target, smoothed.values)


def _take_limits(
    found: TermSearchResult,
    system: OdeSystem,
    target: Target,
    target_sizes: Mapping[str, float],
    candidates: Sequence[CandidateTerm],
    sizes: Mapping[str, float],
) -> TermSearchResult:
    """Replace terms by those that they approach for an extreme scale, if that costs less.

    The calibration of a sign may have ended too early, while that of a function with a scale has not.
    """
    simple = {(each.target, each.text): each for each in candidates if each.scale is None}
    log_n = float(np.log(found.fit.noise.effective_samples))
    for each in found.terms:
        limit = simple.get((each.term.target, each.term.limit))
        if limit is None or any(other.term == limit for other in found.terms):
            continue
        simpler = replace(each, term=limit, penalty=each.penalty - log_n)
        terms = tuple(simpler if other is each else other for other in found.terms)
        numbered = [(other.term, other.number) for other in terms]
        simulation, start = add_terms(found.fit, system, numbered, target_sizes)
        tried = replace(found, fit=calibrate(simulation, target, start), terms=terms)
        tried = _improve(tried, _calibrate_smoothed(tried.fit, target, sizes))
        if tried.cost < found.cost:
            found = tried
    return found


def _move_instants(found: TermSearchResult, target: Target) -> TermSearchResult:
    """Return the equations with other instants of gates, as long as they fit better."""
    places = {parameter.name: place for place, parameter in enumerate(found.fit.simulation.parameters)}
    instants = [
        Coordinate(places[each.parameters[1]], gate.earliest, gate.latest, gate.spacing, gate.change)
        for each in found.terms
        if (gate := each.term.gate) is not None
    ]
    return replace(found, fit=search_pattern(found.fit, target, instants))


def _select_discretisation(found: TermSearchResult, target: Target) -> TermSearchResult:
    """Select the intersample behaviour again, which the missing term may have hidden."""
    simulator = select_intersample(found.fit, target)
    if get_discretisation(simulator) == get_discretisation(found.fit.simulation.simulator):
        return found
    simulation = replace(found.fit.simulation, simulator=simulator)
    return replace(found, fit=calibrate(simulation, target, found.fit.values))


def _eliminate_terms(
    found: TermSearchResult,
    system: OdeSystem,
    target: Target,
    target_sizes: Mapping[str, float],
    run: DiagnosisRun,
) -> TermSearchResult:
    """Remove terms that later ones have made unnecessary; ``system`` has none of them."""
    while len(found.terms) > 1:
        reduced = [tuple(each for each in found.terms if each is not left_out) for left_out in found.terms]
        tasks = []
        for kept in reduced:
            numbered = [(each.term, each.number) for each in kept]
            simulation, start = add_terms(found.fit, system, numbered, target_sizes)
            tasks.append((simulation, [start]))
        fits = calibrate_all(StartsCalibrator(target), tasks, run.parallel_map)
        smaller = [replace(found, fit=fit, terms=kept) for fit, kept in zip(fits, reduced, strict=True)]
        best = min(smaller, key=lambda each: each.cost)
        if best.cost > found.cost + MIN_GAIN:
            break
        found = best
    return found


def _correct_timing(
    found: TermSearchResult,
    system: OdeSystem,
    target: Target,
    target_sizes: Mapping[str, float],
    run: DiagnosisRun,
) -> TermSearchResult:
    """Replace terms that shift a signal in time by another input between samples, or a delay, if they can be.

    A term is claimed only if it explains more than these by the margin of equivalents.
    """
    delays = [each for each in run.effects if each.name == DELAY.name and each not in found.effects]
    for each in found.terms:
        if shifts_in_time(each.term, system):
            kept = tuple(other for other in found.terms if other is not each)
            numbered = [(other.term, other.number) for other in kept]
            simulation, start = add_terms(found.fit, system, numbered, target_sizes)
            without = replace(found, fit=calibrate(simulation, target, start), terms=kept)
            others = [without, *(_with_effect(without, delay, target) for delay in delays)]
            best = min((_select_discretisation(other, target) for other in others), key=attrgetter("cost"))
            if best.cost < found.cost + EQUIVALENCE_MARGIN:
                found = best
    return found


def _with_effect(found: TermSearchResult, effect: Effect, target: Target) -> TermSearchResult:
    """Return the equations with one more effect, calibrated with the terms and without them."""
    fits = []
    for fit in (found.base, found.fit):
        simulation = extend(fit, effect)
        start = transfer_parameters(fit.values, fit.simulation, simulation)
        points = get_starting_points(effect, simulation, fill_gaps(target.y - fit.output))
        starts = np.tile(start, (len(points), 1))
        starts[:, simulation.get_slice(effect)] = points
        fits += calibrate_all(StartsCalibrator(target), [(simulation, list(starts))], map)
    return replace(found, base=fits[0], fit=fits[1])


def _may_lack_a_term(found: TermSearchResult, target: Target) -> bool:
    """Return whether the confidence interval of the coefficient of a term contains zero."""
    names = [parameter.name for parameter in found.fit.simulation.parameters]
    covariance = estimate_covariance(found.fit, target)
    places = [[names.index(each.parameters[0])] for each in found.terms]
    return any(may_be_zero(found.fit.values[place], covariance[np.ix_(place, place)]) for place in places)


def _find_best_term(
    found: TermSearchResult,
    target: Target,
    unweighted: Target,
    candidates: Sequence[CandidateTerm],
    target_sizes: Mapping[str, float],
    run: DiagnosisRun,
) -> TermSearchResult | None:
    """Return the equations with the term that is best after a calibration of all parameters."""
    fit, used = found.fit, {(each.term.target, each.term.text) for each in found.terms}
    (number,) = find_free_numbers(find_used_names(fit), 1)
    values = dict(zip((each.name for each in fit.simulation.parameters), fit.values.tolist(), strict=True))
    equations = get_system(fit).with_values(values)
    free = drop_redundant_terms(
        [each for each in candidates if (each.target, each.text) not in used],
        equations,
        set(target.prior_std),
    )
    log_n, log_choices = float(np.log(fit.noise.effective_samples)), 2.0 * float(np.log(len(candidates)))

    def penalise(term: CandidateTerm) -> float:
        # Any of the candidates could gain by chance.
        return term.degrees_of_freedom * log_n + log_choices

    def rank(terms: Sequence[CandidateTerm]) -> list[RankedTerm]:
        ranked = rank_terms(fit, [target, unweighted], terms, target_sizes, run.parallel_map)
        return [each for each in ranked if each.promise > MIN_PROMISE * (penalise(each.term) + MIN_GAIN)]

    ranked = rank(free)[:FITTED_TERMS]
    if not run.has_inner_terms_only and all(each.term.gate is None for each in found.terms):
        # A step of the input's gain is an effect of the catalogue.
        ranked += _rank_gates([each for each in free if each.text != equations.input], fit, rank)
    tasks = []
    for each in ranked:
        simulation, start = add_terms(fit, get_system(fit), [(each.term, number)], target_sizes)
        tasks.append((simulation, _list_starts(simulation, start, each, number)))
    results = []
    fits = calibrate_all(StartsCalibrator(target), tasks, run.parallel_map)
    for each, fitted in zip(ranked, fits, strict=True):
        if np.isfinite(fitted.score):
            penalty = penalise(each.term)
            added = DiscoveredTerm(each.term, number, fit.score - fitted.score - penalty, penalty)
            results.append(replace(found, fit=fitted, terms=(*found.terms, added)))
    return min(results, key=lambda each: each.cost, default=None)


def _rank_gates(
    candidates: Sequence[CandidateTerm],
    fit: CalibrationResult,
    rank: Callable[[Sequence[CandidateTerm]], list[RankedTerm]],
) -> list[RankedTerm]:
    """Return the best terms that act in a part of the time only, with their instants."""
    context = fit.simulation.context
    found = rank(list_gated_terms(candidates, context.start_time, context.fit_end_time))
    for halvings in range(_GATE_HALVINGS + 1):
        if halvings:
            found = rank([moved for each in found for moved in vary_gate(each.term, halvings)])
        best: dict[tuple[str, str, bool], RankedTerm] = {}
        for each in found:
            best.setdefault(_identify_gate(each.term), each)
        found = list(best.values())[:FITTED_GATES]
    return found


def _identify_gate(term: CandidateTerm) -> tuple[str, str, bool]:
    """Return what a term with a gate and the same one with another instant have in common."""
    assert term.gate is not None
    return term.target, term.text, term.gate.is_onset


def _list_starts(
    simulation: ExtendedSimulator, start: Signal, ranked: RankedTerm, number: int
) -> list[Signal]:
    """Return starting points: coefficients of zero with several scales, and the estimated coefficients."""
    places = {parameter.name: index for index, parameter in enumerate(simulation.parameters)}
    coefficient, *scales = (places[name] for name in ranked.term.name_parameters(number))
    factors = STARTING_SCALES if ranked.term.gate is None else ()
    changes = [(scale, factor * start[scale]) for scale in scales for factor in factors]
    changes += [(coefficient, value) for value in ranked.coefficients]
    starts = np.tile(start, (len(changes) + 1, 1))
    for point, (place, value) in zip(starts[1:], changes, strict=True):
        point[place] = value
    return list(starts)
