"""Calibration of a simulation from several starting points."""

import hashlib
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple, TypeAlias

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import (
    MAX_ITERATIONS,
    MIN_DECREASE,
    CalibrationResult,
    compare_output,
    minimise,
    prior_precision,
)
from islands.diagnosis.calibration.pattern_search import search_jumps
from islands.diagnosis.calibration.target import Target
from islands.effects.interface.context import Signal
from islands.parallel import ParallelMap
from islands.simulators.extended import ExtendedSimulator

#: Iterations of each start of a rough calibration, if the residual is noise and if it is model error, which
#: causes many minima: the first iterations do not show which is the best.
FIRST_ITERATIONS, FIRST_ITERATIONS_WITH_MODEL_ERROR = 6, 12

#: Decrease of the cost at which a rough calibration ends. Scores that differ by this are ties.
ROUGH_DECREASE = 0.5

#: Least number of simulations that are calibrated to convergence, the best ones after a rough calibration, if
#: the residual is noise and if it is model error, and distance from the least cost within which all others
#: are as well.
MIN_CONVERGED, MIN_CONVERGED_WITH_MODEL_ERROR, MAX_DISTANCE = 3, 6, 20.0

#: A simulation to be calibrated, and its starting points.
CalibrationTask: TypeAlias = tuple[ExtendedSimulator, Sequence[Signal]]


class CalibratedStart(NamedTuple):
    """Values of the parameters, shape (parameters,), and the output there, shape (samples,)."""

    values: Signal
    output: Signal


@dataclass(frozen=True, slots=True, eq=False)
class StartsCalibrator:
    """Function that calibrates a simulation from several starts.

    Attributes
    ----------
    target : Target
        What simulations are calibrated to.
    is_rough : bool
        Whether the calibration ends as soon as it shows how much a simulation explains.
    """

    target: Target
    is_rough: bool = False

    def __call__(self, task: CalibrationTask) -> list[CalibratedStart]:
        """Calibrate the starts; return all of them under model error, otherwise the best one."""
        simulation, starts = task
        has_model_error = self.target.effective_samples is not None
        first = FIRST_ITERATIONS_WITH_MODEL_ERROR if has_model_error else FIRST_ITERATIONS
        iterations = first if self.is_rough else MAX_ITERATIONS
        decrease = ROUGH_DECREASE if self.is_rough else MIN_DECREASE
        points = minimise(simulation, self.target, starts, iterations, decrease)
        best = points if has_model_error else [min(points, key=attrgetter("cost"))]
        ends = [CalibratedStart(point.values, point.output) for point in best]
        if not self.is_rough and any(effect.centre is not None for effect in simulation.effects):
            fits = [search_jumps(compare_output(simulation, self.target, *end), self.target) for end in ends]
            ends = [CalibratedStart(fit.values, fit.output) for fit in fits]
        # Copies, since a row would keep the outputs of all points of its simulations in memory.
        return [CalibratedStart(end.values.copy(), end.output.copy()) for end in ends]

    def make_digest(self, task: CalibrationTask) -> str:
        """Return the SHA-256 of all numbers that the result of a task depends on.

        The residual at the first start depends on the simulator, the effects, the record and the whitening.
        """
        simulation, starts = task
        residual = self.target.residual(simulation.simulate(starts[0]))
        prior, limits = prior_precision(simulation, self.target.prior_std), simulation.bounds
        names = [effect.name for effect in simulation.effects]
        weighting = (self.target.effective_samples, self.target.fitted_segments, self.is_rough)
        digest = hashlib.sha256(repr((names, *weighting)).encode())
        for numbers in (residual, *prior, *limits, simulation.scales, *starts):
            digest.update(numbers.tobytes())
        return digest.hexdigest()


def calibrate_all(
    calibrator: StartsCalibrator, tasks: Sequence[CalibrationTask], parallel_map: ParallelMap
) -> list[CalibrationResult]:
    """Return the best fit of each task."""
    return [
        min((compare_output(simulation, calibrator.target, *end) for end in ends), key=attrgetter("score"))
        for (simulation, _), ends in zip(tasks, parallel_map(calibrator, tasks), strict=True)
    ]


def calibrate_best(
    tasks: Sequence[CalibrationTask],
    penalties: Sequence[float],
    target: Target,
    parallel_map: ParallelMap,
) -> list[CalibrationResult]:
    """Return the best fit of each task, roughly, and to convergence if its cost may be the least.

    Parameters
    ----------
    penalties : sequence of float
        Penalty of each simulation, which is added to the score.
    """
    fits = calibrate_all(StartsCalibrator(target, is_rough=True), tasks, parallel_map)
    costs = np.array([fit.score for fit in fits]) + np.array(penalties)
    order = np.argsort(costs, kind="stable")
    # Simulations that are far from the best ones need no better fit.
    near = np.count_nonzero(costs < np.nanmin(costs, initial=np.inf) + MAX_DISTANCE)
    least = MIN_CONVERGED if target.effective_samples is None else MIN_CONVERGED_WITH_MODEL_ERROR
    best = np.sort(order[: max(near, least)])
    starts = [(fits[index].simulation, [fits[index].values]) for index in best]
    for index, fit in zip(best, calibrate_all(StartsCalibrator(target), starts, parallel_map), strict=True):
        fits[index] = fit
    return fits


def make_task_key(calibrator: StartsCalibrator, task: CalibrationTask) -> Hashable:
    """Return a key that is equal for tasks with equal results, given the same simulator and target."""
    simulation, starts = task
    names = tuple(effect.name for effect in simulation.effects)
    return calibrator.is_rough, names, *(start.tobytes() for start in starts)
