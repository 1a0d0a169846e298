"""The ladder: a simulation extended by each effect in turn, each as good as it can be, best first."""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import (
    STEP,
    CalibrationResult,
    Target,
    calibrate,
    evaluate_fit,
    prior_precision,
)
from islands.discrepancy.effects import catalogue_order
from islands.discrepancy.interfaces.effect import Effect, Signal
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.discrepancy.simulators.extended import ExtendedSimulator, invalid_effect_error

#: Points of a grid that a fit begins from, the steps that each may take before one is chosen, and how far a
#: strength is carried from its grid's value.
STARTS, FIRST_STEPS, FARTHEST = 3, 6, 5.0

#: Scores that are less apart are equal: of effects that do the same the one that the catalogue has first goes
#: first, and those of one simulation alone last.
EQUAL = 0.5

#: Effects that are fitted beside others, though by their responses alone none would pay.
PROMISING = 5

#: A simulation to be fitted, and where that begins.
Fit = tuple[ExtendedSimulator, Sequence[Signal]]


@dataclass(frozen=True, slots=True, eq=False)
class ScreenedEffect:
    """A simulation with one more effect.

    Attributes
    ----------
    effect : Effect
    fit : CalibrationResult
    """

    effect: Effect
    fit: CalibrationResult

    def score_gain(self, base: CalibrationResult) -> float:
        """Return by how much it is better than without the effect, its values paid for."""
        return base.score - self.fit.score - bic_penalty(self.effect, base)


def bic_penalty(effect: Effect, base: CalibrationResult) -> float:
    """Return what an effect's values have to gain, as BIC has it: log n for each."""
    values = len(effect.parameters(base.simulation.context)) + effect.extra_degrees_of_freedom
    return values * float(np.log(base.noise.effective_samples))


def screen_effects(
    base: CalibrationResult, target: Target, effects: Iterable[Effect], spread: ParallelMap = map
) -> list[ScreenedEffect]:
    """Extend a simulation by each effect in turn; return the rungs, the best first.

    Parameters
    ----------
    spread : ParallelMap
        Fits the effects, side by side perhaps.
    """
    space = _Projection(base, target)
    screened = []
    for effect in effects:
        simulation = base.simulation.with_effects(catalogue_order((*base.simulation.effects, effect)))
        starts = _starts(base, simulation, effect, target, space)
        if starts:
            screened.append((starts[0][0], effect, simulation, [values for _, values in starts]))
    if base.simulation.effects and target.effective_samples is None:
        # Beside what is there already, the most promising ones alone are worth a fit.
        screened.sort(key=lambda each: each[0])
        screened = [
            each
            for place, each in enumerate(screened)
            if place < PROMISING or space.gained(each[0]) > bic_penalty(each[1], base)
        ]
    found = spread(partial(_fitted, target), [(simulation, starts) for _, _, simulation, starts in screened])
    rungs = [
        ScreenedEffect(effect, min((evaluate_fit(simulation, target, values) for values in ends), key=_score))
        for (_, effect, simulation, _), ends in zip(screened, found, strict=True)
    ]
    return sorted(rungs, key=lambda rung: -round(rung.score_gain(base) / EQUAL))


def _fitted(target: Target, asked: Fit) -> list[Signal]:
    """Fit from every start a few steps far, and from the best one to the end; return the values."""
    simulation, starts = asked
    if target.effective_samples is not None:
        # Where the form is wrong there are many minima, and the first steps do not tell which is the best.
        return [calibrate(simulation, target, start).values for start in starts]
    fits = [calibrate(simulation, target, start, steps=FIRST_STEPS) for start in starts]
    return [calibrate(simulation, target, min(fits, key=_score).values).values]


def is_same_fit(asked: Fit) -> Hashable:
    """Return what two fits of a simulation to a target have in common if they are the same."""
    simulation, starts = asked
    return tuple(effect.name for effect in simulation.effects), *(start.tobytes() for start in starts)


def _score(fit: CalibrationResult) -> float:
    return fit.score


def transfer_parameters(values: Signal, old: ExtendedSimulator, new: ExtendedSimulator) -> Signal:
    """Return the values of a simulation for one with other effects; what is new does nothing yet."""
    moved = new.nominal
    own = len(old.simulator.parameters)
    moved[:own] = values[:own]
    for effect in new.effects:
        if effect in old.effects:
            moved[new.get_slice(effect)] = values[old.get_slice(effect)]
    return moved


class _Projection:
    """What is left of a response when the base's own values have explained what they can."""

    def __init__(self, base: CalibrationResult, target: Target) -> None:
        simulation, values = base.simulation, base.values
        self._target, self._values = target, values.size
        self._sigma = float(np.std(target.residual(base.output))) or 1.0
        pull, nominal = prior_precision(simulation, target.prior_std)
        columns = []
        for place, scale in enumerate(simulation.scales):
            moved = values.copy()
            moved[place] += STEP * scale
            # A tolerance is one more observation of its value.
            held = np.zeros(values.size)
            held[place] = pull[place] * scale
            columns.append(self._observed((simulation.simulate(moved) - base.output) / STEP, held))
        self._basis = np.linalg.qr(np.column_stack(columns))[0] if columns else None
        # Of a value that a fit has moved from where its tolerance wants it, that is left to be explained.
        self.residual = self._left(self._observed(target.y - base.output, pull * (nominal - values)))
        self._samples = base.noise.effective_samples

    def gained(self, remains: float) -> float:
        """Return by how much minus twice the log-likelihood falls where so many squares remain."""
        return self._samples * float(np.log(float(self.residual @ self.residual) / max(remains, 1e-300)))

    def __call__(self, response: Signal) -> Signal:
        return self._left(self._observed(response, np.zeros(self._values)))

    def _left(self, seen: Signal) -> Signal:
        return seen if self._basis is None else seen - self._basis @ (self._basis.T @ seen)

    def _observed(self, response: Signal, held: Signal) -> Signal:
        return np.concatenate([self._target.select(response) / self._sigma, held])


def _points(effect: Effect, simulation: ExtendedSimulator, residual: Signal) -> Sequence[tuple[float, ...]]:
    """Return where a search for an effect begins."""
    part = simulation.get_slice(effect)
    try:
        points = effect.starting_points(simulation.context, residual)
    except Exception as error:
        raise invalid_effect_error(effect, f"its grid fails: {type(error).__name__}: {error}") from error
    if any(len(point) != part.stop - part.start for point in points):
        raise invalid_effect_error(
            effect, f"its grid has to give {part.stop - part.start} values at each point"
        )
    return points


def _starts(
    base: CalibrationResult, simulation: ExtendedSimulator, effect: Effect, target: Target, space: _Projection
) -> list[tuple[float, Signal]]:
    """Return the points of an effect's grid that explain most, its strength fitted to what is left.

    Each stands behind the squares that remain with it.
    """
    part = simulation.get_slice(effect)
    lower, upper = simulation.bounds
    at_rest = transfer_parameters(base.values, base.simulation, simulation)
    tried = []
    for point in _points(effect, simulation, target.y - base.output):
        values = at_rest.copy()
        values[part] = point
        response = space(simulation.simulate(values) - base.output)
        with np.errstate(over="ignore", invalid="ignore"):  # what explodes is no start
            size = float(response @ response)
        if not np.isfinite(size) or size == 0.0:
            continue
        points = [(_squares(space.residual - response), values)]
        if effect.linear_parameters:
            along = np.clip(float(response @ space.residual) / size, -FARTHEST, FARTHEST)
            values = values.copy()
            values[part.start : part.start + effect.linear_parameters] *= along
            values = np.clip(values, lower, upper)
            response = space(simulation.simulate(values) - base.output)
            points.append((_squares(space.residual - response), values))
        remains, values = min(points, key=_first)
        if np.isfinite(remains):
            tried.append((remains, values))
    tried.sort(key=_first)
    return tried[:STARTS]


def _squares(left: Signal) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        remains = float(left @ left)
    return remains if np.isfinite(remains) else float("inf")


def _first(point: tuple[float, Signal]) -> float:
    return point[0]
