"""Screening: a simulation extended by each effect in turn, calibrated and sorted by score."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.starts_calibrator import CalibrationTask, calibrate_best
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.gross_errors.closed_loop import acts_at_once
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import ACTUATOR_MAPS, SENSOR_MAPS
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect, Site, invalid_effect_error
from islands.records.segments import fill_gaps
from islands.simulators.extended import ExtendedSimulator

#: Maximum number of starting points per effect that are calibrated.
MAX_STARTS = 3

#: Largest factor by which the strength of a starting point is scaled.
MAX_SCALING = 5.0

#: Scores that differ by less than this are ties. Ties keep the catalogue order, in which effects that belong
#: to one simulator come last.
SCORE_TIE = 0.5

#: Singular values below this fraction of the largest one are linear dependences of responses.
DEPENDENCE = 1e-6

#: Minimum number of effects that are calibrated in addition to others, even if their linear responses promise
#: no gain.
MIN_CALIBRATED_EFFECTS = 5

#: Fraction of the best promised gain below which a further effect is not calibrated. If the noise is small,
#: every effect promises more than its penalty.
MIN_PROMISE = 0.05

#: Names, since effects that were sent to another process do not equal those of the catalogue.
_ACTUATOR_NAMES, _SENSOR_NAMES = ({each.name for each in maps} for maps in (ACTUATOR_MAPS, SENSOR_MAPS))

#: Least decrease of the score by another order of maps than that of the catalogue.
MIN_ORDER_GAIN = 6.0

#: Largest response at the sample of a pulse, relative to the largest one, of an effect on a record with
#: feedback within a sample. A delay of less than a sample interpolates, and reads the sample that follows.
MAX_LATE_RESPONSE = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class ScreenedEffect:
    """A simulation with one additional effect.

    Attributes
    ----------
    effect : Effect
    fit : CalibrationResult
    """

    effect: Effect
    fit: CalibrationResult

    def score_gain(self, base: CalibrationResult) -> float:
        """Return the decrease of the score relative to ``base``, less the BIC penalty of the effect."""
        return base.score - self.fit.score - bic_penalty(self.effect, base)


def bic_penalty(effect: Effect, base: CalibrationResult) -> float:
    """Return the BIC penalty of an effect: log n for each of its degrees of freedom."""
    return count_degrees(effect, base) * float(np.log(base.noise.effective_samples))


def count_degrees(effect: Effect, base: CalibrationResult) -> int:
    """Count the degrees of freedom of an effect: its values in all recordings, and its selected instants."""
    parameters = effect.parameters(base.simulation.context)
    further_recordings = max(len(base.simulation.parts) - 1, 0)
    values = len(parameters) + further_recordings * sum(each.initial for each in parameters)
    return values + effect.extra_degrees_of_freedom


def compute_cost(fit: CalibrationResult, base: CalibrationResult) -> float:
    """Return the score of a fit plus the BIC penalties of its effects."""
    return fit.score + sum(bic_penalty(effect, base) for effect in fit.simulation.effects)


def screen_effects(
    base: CalibrationResult, target: Target, run: DiagnosisRun, larger: CalibrationResult | None = None
) -> list[ScreenedEffect]:
    """Extend a simulation by each effect in turn and calibrate it; return the best first.

    Parameters
    ----------
    base : CalibrationResult
    target : Target
    run : DiagnosisRun
    larger : CalibrationResult, optional
        Fit of the simulation with one effect more. Calibrations start from its values as well: without that
        effect, the others may be in another minimum.
    """
    projection = Projection(base, target)
    candidates = [
        (min(starts[0][0] for starts in places if starts), effect, places)
        for effect, places in zip(
            run.effects, run.parallel_map(StartFinder(base, target, projection), run.effects), strict=True
        )
        if any(places)
    ]
    is_noise = target.effective_samples is None
    if base.simulation.effects and is_noise:
        # If the simulation has effects already, only the most promising further ones are worth a calibration.
        candidates.sort(key=lambda candidate: candidate[0])
        promises = [projection.score_decrease(remaining) for remaining, *_ in candidates]
        candidates = [
            candidate
            for index, (candidate, promise) in enumerate(zip(candidates, promises, strict=True))
            if index < MIN_CALIBRATED_EFFECTS
            or promise > max(bic_penalty(candidate[1], base), MIN_PROMISE * promises[0])
        ]
    tasks, added = list[CalibrationTask](), list[Effect]()
    for _, effect, places in candidates:
        for simulation, starts in zip(list_orders(base, effect), places, strict=True):
            points = [values for _, values in starts]
            if larger is not None:
                points += [_start_from(larger, simulation, effect, values) for values in points[:1]]
            if points:
                tasks.append((simulation, points))
                added.append(effect)
    penalties = [bic_penalty(effect, base) for effect in added]
    fits = calibrate_best(tasks, penalties, target, run.parallel_map)
    screened = choose_orders(map(ScreenedEffect, added, fits))
    if target.has_feedback:  # The input of the same sample contains the noise.
        screened = [each for each in screened if not acts_at_once(each.fit, MAX_LATE_RESPONSE)]
    return sorted(screened, key=lambda each: -round(each.score_gain(base) / SCORE_TIE))


def transfer_parameters(values: Signal, old: ExtendedSimulator, new: ExtendedSimulator) -> Signal:
    """Return the values of a simulation for one with other effects; new effects have their nominal values."""
    transferred = new.nominal
    transferred[new.simulator_slice] = values[old.simulator_slice]
    transfer_effects(values, old, transferred, new)
    return transferred


def transfer_effects(
    values: Signal, old: ExtendedSimulator, transferred: Signal, new: ExtendedSimulator
) -> None:
    """Set the values of the effects that two simulations have in common, in place."""
    for effect in new.effects:
        if effect in old.effects:
            transferred[new.get_slice(effect)] = values[old.get_slice(effect)]


def get_starting_points(
    effect: Effect, simulation: ExtendedSimulator, residual: Signal
) -> Sequence[tuple[float, ...]]:
    """Return the starting points of an effect after checking them."""
    count = len(effect.parameters(simulation.context))
    try:
        points = effect.starting_points(simulation.context, residual)
    except Exception as error:
        raise invalid_effect_error(
            effect, f"its starting points fail: {type(error).__name__}: {error}"
        ) from error
    if any(len(point) != count for point in points):
        raise invalid_effect_error(effect, f"each of its starting points needs {count} values")
    return points


def simulate_starting_points(
    base: CalibrationResult, simulation: ExtendedSimulator, effect: Effect, target: Target
) -> tuple[Signal, Signal]:
    """Simulate the starting points of an effect, at once if possible; those that diverge are left out.

    Parameters
    ----------
    simulation : ExtendedSimulator
        The simulation of ``base``, extended by the effect.

    Returns
    -------
    ndarray, shape (points, parameters)
        Values.
    ndarray, shape (points, samples)
        Changes of the output of ``base``.
    """
    given = get_starting_points(
        effect, _measure_in_front(base, simulation, effect), fill_gaps(target.y - base.output)
    )
    points = np.tile(transfer_parameters(base.values, base.simulation, simulation), (len(given), 1))
    if not given:
        return points, np.empty((0, base.output.size))
    points[:, simulation.get_slice(effect)] = [simulation.expand(effect, point) for point in given]
    responses = simulation.simulate_batch(points) - base.output
    is_finite = np.isfinite(responses).all(axis=1)
    return points[is_finite], responses[is_finite]


def _measure_in_front(
    base: CalibrationResult, simulation: ExtendedSimulator, effect: Effect
) -> ExtendedSimulator:
    """Return an extended simulation whose measured output is that in front of the maps that act after it."""
    place, context = simulation.effects.index(effect), simulation.context
    behind = [each for each in simulation.effects[place + 1 :] if each.site == Site.OUTPUT]
    if effect.site != Site.OUTPUT or not behind or context.measured is None:
        return simulation
    others = tuple(each for each in base.simulation.effects if each not in behind)
    front = replace(base.simulation, effects=others)
    output = front.simulate(transfer_parameters(base.values, base.simulation, front))
    return replace(simulation, context=replace(context, measured=context.measured - base.output + output))


@dataclass(frozen=True, slots=True, eq=False)
class StartFinder:
    """Function that finds the starting points of an effect that explain most.

    Attributes
    ----------
    base : CalibrationResult
        Simulation without the effect.
    target : Target
    projection : Projection
        Projection for the base.
    """

    base: CalibrationResult
    target: Target
    projection: Projection

    def __call__(self, effect: Effect) -> list[list[tuple[float, Signal]]]:
        """Return the starting points in each place where an effect may act; see `list_orders`.

        Returns
        -------
        list of list of (float, ndarray)
            Remaining sum of squares and parameter values, the smallest sum first.
        """
        return [self._find(effect, simulation) for simulation in list_orders(self.base, effect)]

    def _find(self, effect: Effect, simulation: ExtendedSimulator) -> list[tuple[float, Signal]]:
        """Return starting points, each with its strength scaled if that explains more.

        The starting points of a free form are combined to the one that explains most.
        """
        base, projection = self.base, self.projection
        part = simulation.get_slice(effect)
        points, changes = simulate_starting_points(base, simulation, effect, self.target)
        responses = [projection(change) for change in changes]
        if effect.is_free and responses:
            weights = np.linalg.lstsq(np.column_stack(responses), projection.residual, rcond=DEPENDENCE)[0]
            if not np.isfinite(weights).all():  # the responses are smaller than any normal number
                return []
            combined = points[:1].copy()
            combined[0, part] = weights @ points[:, part]
            points, responses = combined, [projection(simulation.simulate(combined[0]) - base.output)]
        sizes = np.array([_sum_squares(response) for response in responses])
        usable = np.flatnonzero(np.isfinite(sizes) & (sizes > 0.0))
        starts = [(_sum_squares(projection.residual - responses[index]), points[index]) for index in usable]
        if effect.linear_parameters and usable.size:
            factors = [float(responses[index] @ projection.residual) / sizes[index] for index in usable]
            scaled = scale_strengths(simulation, effect, points[usable], np.array(factors))
            others = simulation.simulate_batch(scaled) - base.output
            starts = [
                min(start, (_sum_squares(projection.residual - projection(other)), values), key=itemgetter(0))
                for start, other, values in zip(starts, others, scaled, strict=True)
            ]
        return sorted((each for each in starts if np.isfinite(each[0])), key=itemgetter(0))[:MAX_STARTS]


def scale_strengths(simulation: ExtendedSimulator, effect: Effect, points: Signal, factors: Signal) -> Signal:
    """Return points with the strengths of an effect scaled, within `MAX_SCALING` and the bounds.

    Parameters
    ----------
    simulation : ExtendedSimulator
    effect : Effect
        Without linear parameters, it has no strength to scale.
    points : ndarray, shape (points, parameters)
    factors : ndarray, shape (points,)
    """
    scaled, begin = points.copy(), simulation.get_slice(effect).start
    scaled[:, begin : begin + effect.linear_parameters] *= np.clip(factors, -MAX_SCALING, MAX_SCALING)[
        :, None
    ]
    return simulation.project(scaled)


def _start_from(
    larger: CalibrationResult, simulation: ExtendedSimulator, effect: Effect, start: Signal
) -> Signal:
    """Return the values of a fit for a simulation with another effect, which begins at a starting point."""
    values = transfer_parameters(larger.values, larger.simulation, simulation)
    if effect not in larger.simulation.effects:
        part = simulation.get_slice(effect)
        values[part] = start[part]
    return values


def extend(base: CalibrationResult, effect: Effect) -> ExtendedSimulator:
    """Return the simulation of a fit with one additional effect."""
    return base.simulation.with_effects((*base.simulation.effects, effect))


def choose_orders(screened: Iterable[ScreenedEffect]) -> list[ScreenedEffect]:
    """Return the best fit of each effect; the first one unless another order gains enough."""
    best: dict[str, ScreenedEffect] = {}
    for each in screened:
        known = best.setdefault(each.effect.name, each)
        if each.fit.score < known.fit.score - MIN_ORDER_GAIN:
            best[each.effect.name] = each
    return list(best.values())


def list_orders(base: CalibrationResult, effect: Effect) -> list[ExtendedSimulator]:
    """Return the simulations of a fit with one additional effect, in each place where it may act.

    The first place is that of the catalogue. A map of an actuator may act on the other side of the others,
    and a map of a sensor on the other side of the other maps of the output.
    """
    simulation = extend(base, effect)
    known = base.simulation.effects
    places = [place for place, each in enumerate(known) if _depends_on_order(effect, each)]
    if not places:
        return [simulation]
    is_first = simulation.effects.index(effect) <= places[0]
    place = places[-1] + 1 if is_first else places[0]
    effects = (*known[:place], effect, *known[place:])
    return [simulation, replace(simulation, effects=effects)]


def _depends_on_order(effect: Effect, other: Effect) -> bool:
    """Return whether the response to two effects depends on the order in which they act."""
    if effect.name in _ACTUATOR_NAMES:
        return other.name in _ACTUATOR_NAMES
    are_maps = all(each.site == Site.OUTPUT and not each.is_free for each in (effect, other))
    return are_maps and not _SENSOR_NAMES.isdisjoint((effect.name, other.name))


def _sum_squares(signal: Signal) -> float:
    """Return the sum of squares; infinite if the signal has diverged."""
    with np.errstate(over="ignore", invalid="ignore"):
        squares = float(signal @ signal)
    return squares if np.isfinite(squares) else float("inf")
