"""Ranking of candidate terms by the part of the residual that they explain."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.calibration.intersample_selection import enlarge_step
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.candidate_terms import CandidateTerm, find_free_numbers
from islands.diagnosis.discovery.equation_simulator import add_terms, find_used_names, get_system
from islands.effects.interface.context import Signal
from islands.parallel import ParallelMap

#: Number of terms whose responses are simulated in one call. The equations of every lane contain all of them:
#: more terms in a call save nothing.
TERMS_PER_CALL = 8

#: Ratio of the parts of the residual that a response and a linear response explain, from which the former is
#: another one.
MIN_NONLINEAR_GAIN = 1.1


class RankedTerm(NamedTuple):
    """A term, as far as its responses explain the residual.

    Attributes
    ----------
    term : CandidateTerm
    coefficients : tuple of float
        Estimates of its coefficient at which it explains more than its linear response.
    promise : float
        Largest decrease of minus twice the log-likelihood that its responses promise.
    """

    term: CandidateTerm
    coefficients: tuple[float, ...]
    promise: float


def rank_terms(
    fit: CalibrationResult,
    targets: Sequence[Target],
    candidates: Sequence[CandidateTerm],
    target_sizes: Mapping[str, float],
    parallel_map: ParallelMap,
) -> list[RankedTerm]:
    """Return the terms in the order of the part of the residual that their responses explain.

    Each term is simulated with a small coefficient, and with the one at which that response explains most:
    the response to a term that changes within few samples, such as friction, is far from linear. The steps
    are larger than those of the fit if that changes its output little.

    Parameters
    ----------
    fit : CalibrationResult
        The equations without the terms.
    targets : sequence of Target
        Targets with different noise models; the best rank of a term counts. A noise model of a residual that
        is mainly caused by what the equations lack suppresses this, and without one, slow noise hides it.
    candidates : sequence of CandidateTerm
    target_sizes : mapping
        Largest absolute values of the right-hand sides.
    parallel_map : ParallelMap
        Simulates the terms.
    """
    if not candidates:
        return []
    projections, coarse = [Projection(fit, target) for target in targets], enlarge_step(fit)

    def explain_group(group: Sequence[CandidateTerm]) -> NDArray[np.float64]:
        # Terms that differ in their scales alone, as in instants, are one term of the equations.
        laws = {(each.target, each.text, each.gate): each for each in group}
        numbers = dict(zip(laws, find_free_numbers(find_used_names(fit), len(laws)), strict=True))
        numbered = [(law, numbers[key]) for key, law in laws.items()]
        simulation, start = add_terms(coarse, get_system(fit), numbered, target_sizes)
        index = {parameter.name: place for place, parameter in enumerate(simulation.parameters)}
        starts, places = np.tile(start, (len(group), 1)), []
        for row, each in zip(starts, group, strict=True):
            coefficient, *scales = each.name_parameters(numbers[each.target, each.text, each.gate])
            places.append(index[coefficient])
            row[[index[name] for name in scales]] = each.scale

        def respond(coefficients: Signal, are_small: bool) -> Signal:
            """Return the responses to one term at a time, shape (rows, terms, samples)."""
            points = np.tile(starts, (len(coefficients), 1))
            points[np.arange(len(points)), np.tile(places, len(coefficients))] = coefficients.ravel()
            if are_small and simulation.fits_states:
                # States that are fitted to first order take a thirteenth of the simulations.
                near = np.full(len(points) + 1, len(points))
                outputs = simulation.simulate_batch(np.vstack([points, start]), near)[:-1]
            else:
                outputs = simulation.simulate_batch(points)
            return (outputs - coarse.output).reshape(*coefficients.shape, -1)

        small = np.array([[simulation.parameters[place].nominal for place in places]])
        (responses,) = respond(small, are_small=True)
        linear = np.array([[_explain(each, projection) for each in responses] for projection in projections])
        large = small * linear[:, :, 1]
        # All targets share a call, since the lanes of one would not fill it.
        explained = [
            [_explain(each, projection)[0] for each in responses]
            for responses, projection in zip(respond(large, are_small=False), projections, strict=True)
        ]
        return np.dstack([linear[:, :, 0], explained, large])

    groups = [
        candidates[first : first + TERMS_PER_CALL] for first in range(0, len(candidates), TERMS_PER_CALL)
    ]
    # Of shape (targets, terms, 3): parts that the linear and the other response explain, and the coefficient.
    found = np.concatenate(list(parallel_map(explain_group, groups)), axis=1)
    explained = found[:, :, :2].max(axis=2)
    rank = np.argsort(np.argsort(-explained, axis=1, kind="stable"), axis=1).min(axis=0)
    ranked = []
    squares = [float(each.residual @ each.residual) for each in projections]
    for index in np.argsort(rank, kind="stable"):
        if explained[:, index].max() > 0.0:
            chosen = found[:, index]
            is_other = chosen[:, 1] > MIN_NONLINEAR_GAIN * chosen[:, 0]
            promises = [
                projection.score_decrease(whole - part)
                for projection, whole, part in zip(projections, squares, explained[:, index], strict=True)
            ]
            coefficients = tuple(chosen[is_other, 2].tolist())
            ranked.append(RankedTerm(candidates[index], coefficients, max(promises)))
    return ranked


def _explain(response: Signal, projection: Projection) -> tuple[float, float]:
    """Return the sum of squares of the residual that a response explains, and its factor in the residual."""
    if not np.isfinite(response).all():
        return 0.0, 0.0
    projected = projection(response)
    energy, product = float(projected @ projected), float(projected @ projection.residual)
    return (product**2 / energy, product / energy) if energy > 0.0 else (0.0, 0.0)
