"""Calibration of a simulation from several starting points."""

import hashlib
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import TypeAlias

from islands.discrepancy.calibration.levenberg_marquardt import Target, calibrate, prior_precision
from islands.discrepancy.interfaces.effect import Signal
from islands.discrepancy.simulators.extended import ExtendedSimulator

#: Iterations of each start before the best one is calibrated to convergence.
FIRST_ITERATIONS = 6

#: A simulation to be calibrated, and its starting points.
CalibrationTask: TypeAlias = tuple[ExtendedSimulator, Sequence[Signal]]


@dataclass(frozen=True, slots=True, eq=False)
class StartsCalibrator:
    """Function that calibrates a simulation from several starts.

    Attributes
    ----------
    target : Target
        What simulations are calibrated to.
    """

    target: Target

    def __call__(self, task: CalibrationTask) -> list[Signal]:
        """Return the values of those starts that were calibrated to convergence.

        These are all starts under model error, and otherwise the best one after a few iterations.

        Returns
        -------
        list of ndarray, each of shape (parameters,)
        """
        simulation, starts = task
        target = self.target
        if target.effective_samples is not None:
            # Model error causes many minima, and the first iterations do not show which is the best.
            return [calibrate(simulation, target, start).values for start in starts]
        fits = [calibrate(simulation, target, start, max_iterations=FIRST_ITERATIONS) for start in starts]
        return [calibrate(simulation, target, min(fits, key=attrgetter("score")).values).values]

    def make_digest(self, task: CalibrationTask) -> str:
        """Return the SHA-256 of all numbers that the result of a task depends on.

        The residual at the first start depends on the simulator, the effects, the record and the whitening.
        """
        simulation, starts = task
        residual = self.target.residual(simulation.simulate(starts[0]))
        prior, limits = prior_precision(simulation, self.target.prior_std), simulation.bounds
        names = [effect.name for effect in simulation.effects]
        weighting = (self.target.effective_samples, self.target.fitted_segments)
        digest = hashlib.sha256(repr((names, *weighting)).encode())
        for numbers in (residual, *prior, *limits, simulation.scales, *starts):
            digest.update(numbers.tobytes())
        return digest.hexdigest()


def make_task_key(task: CalibrationTask) -> Hashable:
    """Return a key that is equal for tasks with equal results, given the same simulator and target."""
    simulation, starts = task
    return tuple(effect.name for effect in simulation.effects), *(start.tobytes() for start in starts)
