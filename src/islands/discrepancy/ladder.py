"""The ladder: a simulation extended by each effect in turn, each as good as it can be, best first."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from islands.discrepancy.calibration import STEP, Calibrated, Target, calibrate, pull_of
from islands.discrepancy.effect import Effect, Signal
from islands.discrepancy.effects import in_order
from islands.discrepancy.extended import Extended

#: Points of a grid that a fit begins from, and how far a strength is carried from its grid's value.
STARTS, FARTHEST = 3, 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Rung:
    """A simulation with one more effect.

    Attributes
    ----------
    effect : Effect
    fit : Calibrated
    """

    effect: Effect
    fit: Calibrated

    def gained(self, base: Calibrated) -> float:
        """Return by how much it is better than without the effect, its values paid for."""
        return base.score - self.fit.score - price(self.effect, base)


def price(effect: Effect, base: Calibrated) -> float:
    """Return what an effect's values have to gain, as BIC has it: log n for each."""
    values = len(effect.parameters(base.simulation.scene)) + effect.searched
    return values * float(np.log(base.noise.samples))


def ladder(base: Calibrated, target: Target, effects: Iterable[Effect]) -> list[Rung]:
    """Extend a simulation by each effect in turn; return the rungs, the best first."""
    space = _Projection(base, target)
    rungs = []
    for effect in effects:
        simulation = base.simulation.with_effects(in_order((*base.simulation.effects, effect)))
        starts = _starts(base, simulation, effect, target, space)
        if starts:
            fits = [calibrate(simulation, target, start) for start in starts]
            rungs.append(Rung(effect, min(fits, key=lambda fit: fit.score)))
    return sorted(rungs, key=lambda rung: -rung.gained(base))


def carried(values: Signal, old: Extended, new: Extended) -> Signal:
    """Return the values of a simulation for one with other effects; what is new does nothing yet."""
    moved = new.nominal
    own = len(old.core.parameters)
    moved[:own] = values[:own]
    for effect in new.effects:
        if effect in old.effects:
            moved[new.part(effect)] = values[old.part(effect)]
    return moved


class _Projection:
    """What is left of a response when the base's own values have explained what they can."""

    def __init__(self, base: Calibrated, target: Target) -> None:
        simulation, values = base.simulation, base.values
        self._target, self._values = target, values.size
        self._sigma = float(np.std(target.residual(base.output))) or 1.0
        pull, _ = pull_of(simulation, target.tolerance)
        columns = []
        for place, scale in enumerate(simulation.scales):
            moved = values.copy()
            moved[place] += STEP * scale
            # A tolerance is one more observation of its value.
            held = np.zeros(values.size)
            held[place] = pull[place] * scale
            columns.append(self._observed((simulation.simulate(moved) - base.output) / STEP, held))
        self._basis = np.linalg.qr(np.column_stack(columns))[0] if columns else None
        self.residual = self(target.y - base.output)

    def __call__(self, response: Signal) -> Signal:
        seen = self._observed(response, np.zeros(self._values))
        if self._basis is None:
            return seen
        left: Signal = seen - self._basis @ (self._basis.T @ seen)
        return left

    def _observed(self, response: Signal, held: Signal) -> Signal:
        return np.concatenate([self._target.observed(response) / self._sigma, held])


def _starts(
    base: Calibrated, simulation: Extended, effect: Effect, target: Target, space: _Projection
) -> list[Signal]:
    """Return the points of an effect's grid that explain most, its strength fitted to what is left."""
    part = simulation.part(effect)
    lower, upper = simulation.bounds
    at_rest = carried(base.values, base.simulation, simulation)
    tried = []
    for point in effect.grid(simulation.scene, target.y - base.output):
        values = at_rest.copy()
        values[part] = point
        response = space(simulation.simulate(values) - base.output)
        with np.errstate(over="ignore", invalid="ignore"):  # what explodes is no start
            size = float(response @ response)
        if not np.isfinite(size) or size == 0.0:
            continue
        if effect.linear:
            along = np.clip(float(response @ space.residual) / size, -FARTHEST, FARTHEST)
            values[part.start : part.start + effect.linear] *= along
            values = np.clip(values, lower, upper)
            response = space(simulation.simulate(values) - base.output)
        left = space.residual - response
        with np.errstate(over="ignore", invalid="ignore"):
            remains = float(left @ left)
        if np.isfinite(remains):
            tried.append((remains, values))
    tried.sort(key=lambda each: each[0])
    return [values for _, values in tried[:STARTS]]
