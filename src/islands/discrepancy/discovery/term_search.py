"""Search for terms that the equations of a simulation lack.

Each candidate term is simulated in its equation. Its response to a small coefficient, without the part that
the other parameters reproduce, says how much of the residual it explains: forward selection by the error
reduction ratio (Billings, Nonlinear System Identification, section 3), with responses instead of regressors.
The most promising terms are then fitted with all parameters by the Levenberg-Marquardt method.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from islands.discrepancy.calibration.intersample_selection import get_discretisation, select_intersample
from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, calibrate, whiten_target
from islands.discrepancy.calibration.projection import Projection
from islands.discrepancy.calibration.starts_calibrator import StartsCalibrator, calibrate_all
from islands.discrepancy.calibration.target import Target
from islands.discrepancy.discovery.candidate_terms import (
    CandidateTerm,
    find_free_numbers,
    list_candidate_terms,
)
from islands.discrepancy.discovery.equation_simulator import find_equations, with_equations
from islands.discrepancy.inference.stepwise_search import MIN_GAIN
from islands.discrepancy.interfaces.context import Signal
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.discrepancy.simulators.coordinates import peak_amplitude
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.systems.ode.ode_expression import render
from islands.systems.ode.ode_system import OUTPUT, OdeSystem

#: Number of terms whose responses are simulated in one call. The equations of every lane contain all of them:
#: more terms in a call save nothing.
TERMS_PER_CALL = 8

#: Maximum number of terms.
MAX_TERMS = 3

#: Number of terms of each step that are fitted with all parameters.
FITTED_TERMS = 12


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


@dataclass(frozen=True, slots=True, eq=False)
class TermSearchResult:
    """Equations with the terms that a search has added.

    Attributes
    ----------
    fit : CalibrationResult
    terms : tuple of DiscoveredTerm
        In the order in which they were found.
    """

    fit: CalibrationResult
    terms: tuple[DiscoveredTerm, ...]

    @property
    def cost(self) -> float:
        """Score of the fit plus the penalties of its terms; less is better."""
        return self.fit.score + sum(each.penalty for each in self.terms)

    def describe(self) -> str:
        """Return the extended equations and the values of their new parameters as one line."""
        system = _get_system(self.fit)
        right_sides = {**dict(system.derivatives), OUTPUT: system.output}
        changed = dict.fromkeys(each.term.target for each in self.terms)
        lines = [
            f"{target if target == OUTPUT else f'd{target}/dt'} = {render(right_sides[target])}"
            for target in changed
        ]
        values = {
            parameter.name: f"{parameter.name} = {value:.4g} {parameter.unit}".rstrip()
            for parameter, value in zip(self.fit.simulation.parameters, self.fit.values, strict=True)
        }
        new = [values[name] for each in self.terms for name in each.parameters]
        return "; ".join([*lines, ", ".join(new)])


def search_terms(
    base: CalibrationResult, target: Target, parallel_map: ParallelMap = map
) -> TermSearchResult | None:
    """Add terms to the equations of a simulation as long as each gains more than any would by chance.

    Parameters
    ----------
    base : CalibrationResult
        The calibrated simulation.
    target : Target
    parallel_map : ParallelMap
        Fits the terms.

    Returns
    -------
    TermSearchResult or None
        None if the simulator has no equations, or if no term gains enough.
    """
    equations = find_equations(base.simulation.simulator)
    if equations is None:
        return None
    context = base.simulation.context
    system = equations.system
    rate = peak_amplitude(context.take_differences(context.u)) / context.dt
    sizes = {**equations.sizes, system.input: context.input_peak, f"rate({system.input})": rate}
    units = {each.name: each.unit for each in system.states}
    units |= {system.input: context.input_unit, OUTPUT: context.output_unit}
    candidates = list_candidate_terms(system, sizes, context.duration, units)
    target_sizes = {
        OUTPUT: context.output_peak,
        **{name: sizes[f"d{name}/dt"] for name, _ in system.derivatives},
    }
    found = TermSearchResult(base, ())
    while len(found.terms) < MAX_TERMS:
        target = whiten_target(target, found.fit)
        found = _improve(found, calibrate(found.fit.simulation, target, found.fit.values))
        best = _find_best_term(found, target, candidates, target_sizes, parallel_map)
        if best is None or best.cost > found.cost - MIN_GAIN:
            break
        found = _eliminate_terms(_select_discretisation(best, target), system, target, target_sizes)
    return found if found.terms else None


def _improve(found: TermSearchResult, fit: CalibrationResult) -> TermSearchResult:
    """Return the equations with another fit, if that is better."""
    return replace(found, fit=fit) if fit.score < found.fit.score else found


def _select_discretisation(found: TermSearchResult, target: Target) -> TermSearchResult:
    """Select the intersample behaviour again, which the missing term may have hidden."""
    simulator = select_intersample(found.fit, target)
    if get_discretisation(simulator) == get_discretisation(found.fit.simulation.simulator):
        return found
    simulation = replace(found.fit.simulation, simulator=simulator)
    return replace(found, fit=calibrate(simulation, target, found.fit.values))


def _eliminate_terms(
    found: TermSearchResult, system: OdeSystem, target: Target, target_sizes: Mapping[str, float]
) -> TermSearchResult:
    """Remove terms that later ones have made unnecessary; ``system`` has none of them."""
    while len(found.terms) > 1:
        smaller = []
        for left_out in found.terms:
            kept = tuple(each for each in found.terms if each is not left_out)
            numbered = [(each.term, each.number) for each in kept]
            simulation, start = _add_terms(found.fit, system, numbered, target_sizes)
            smaller.append(TermSearchResult(calibrate(simulation, target, start), kept))
        best = min(smaller, key=lambda each: each.cost)
        if best.cost > found.cost + MIN_GAIN:
            break
        found = best
    return found


def _find_best_term(
    found: TermSearchResult,
    target: Target,
    candidates: Sequence[CandidateTerm],
    target_sizes: Mapping[str, float],
    parallel_map: ParallelMap,
) -> TermSearchResult | None:
    """Return the equations with the term that is best after a calibration of all parameters."""
    fit, used = found.fit, {(each.term.target, each.term.text) for each in found.terms}
    (number,) = find_free_numbers(_get_system(fit), 1)
    free = [each for each in candidates if (each.target, each.text) not in used]
    log_n, log_choices = float(np.log(fit.noise.effective_samples)), 2.0 * float(np.log(len(candidates)))
    terms = _rank_terms(fit, target, free, target_sizes, parallel_map)[:FITTED_TERMS]
    extended = [_add_terms(fit, _get_system(fit), [(term, number)], target_sizes) for term in terms]
    tasks = [(simulation, [start]) for simulation, start in extended]
    results = []
    for term, fitted in zip(terms, calibrate_all(StartsCalibrator(target), tasks, parallel_map), strict=True):
        if not np.isfinite(fitted.score):
            continue
        # Any of the candidates could gain by chance.
        penalty = term.value_count * log_n + log_choices
        added = DiscoveredTerm(term, number, fit.score - fitted.score - penalty, penalty)
        results.append(TermSearchResult(fitted, (*found.terms, added)))
    return min(results, key=lambda each: each.cost, default=None)


def _rank_terms(
    fit: CalibrationResult,
    target: Target,
    candidates: Sequence[CandidateTerm],
    target_sizes: Mapping[str, float],
    parallel_map: ParallelMap,
) -> list[CandidateTerm]:
    """Return the terms in the order of the part of the residual that their linear responses explain."""
    projection = Projection(fit, target)

    def explain_group(group: Sequence[CandidateTerm]) -> list[float]:
        # Each lane has the coefficient of one of the terms.
        numbers = find_free_numbers(_get_system(fit), len(group))
        numbered = list(zip(group, numbers, strict=True))
        simulation, start = _add_terms(fit, _get_system(fit), numbered, target_sizes)
        places = {parameter.name: index for index, parameter in enumerate(simulation.parameters)}
        points = np.tile(start, (len(group), 1))
        for point, (term, number) in zip(points, numbered, strict=True):
            place = places[term.name_parameters(number)[0]]
            point[place] = simulation.parameters[place].nominal
        outputs = simulation.simulate_batch(points)
        return [_explain(output - fit.output, projection) for output in outputs]

    groups = [
        candidates[first : first + TERMS_PER_CALL] for first in range(0, len(candidates), TERMS_PER_CALL)
    ]
    explained = [each for group in parallel_map(explain_group, groups) for each in group]
    order = np.argsort(-np.array(explained), kind="stable")
    return [candidates[index] for index in order if explained[index] > 0.0]


def _explain(response: Signal, projection: Projection) -> float:
    """Return the sum of squares of the residual that a response explains."""
    if not np.isfinite(response).all():
        return 0.0
    projected = projection(response)
    energy = float(projected @ projected)
    return float(projected @ projection.residual) ** 2 / energy if energy > 0.0 else 0.0


def _add_terms(
    fit: CalibrationResult,
    system: OdeSystem,
    terms: Sequence[tuple[CandidateTerm, int]],
    target_sizes: Mapping[str, float],
) -> tuple[ExtendedSimulator, Signal]:
    """Return a simulation of a system with more, numbered terms, and its values.

    Known parameters have the values of ``fit``; coefficients of new terms are zero.
    """
    for term, number in terms:
        system = term.add_to(system, number, target_sizes[term.target])
    simulation = replace(fit.simulation, simulator=with_equations(fit.simulation.simulator, system))
    values = {term.name_parameters(number)[0]: 0.0 for term, number in terms}
    values |= {each.name: v for each, v in zip(fit.simulation.parameters, fit.values, strict=True)}
    start = [values.get(parameter.name, parameter.nominal) for parameter in simulation.parameters]
    return simulation, np.array(start)


def _get_system(fit: CalibrationResult) -> OdeSystem:
    equations = find_equations(fit.simulation.simulator)
    assert equations is not None
    return equations.system
