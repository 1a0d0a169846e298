"""How a core is solved: what its input does between samples, and in how fine steps; before anything else.

Both imitate physics where they are wrong: a hold that is not the record's looks like a delay, too coarse a
step like damping.
"""

from dataclasses import replace

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, Target, calibrate
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.discrepancy.simulators.intersample import InterSample, ResampledSimulator

#: Steps a sample at the most, and the change that finer ones may make, in what is left over.
FINEST, NOTICED = 32, 0.05

#: By how much another hold has to fit better, in minus twice the log-likelihood.
BETTER = 10.0


def select_intersample(fit: CalibrationResult, target: Target) -> Simulator:
    """Return the core of a fit, solved as the record asks for it."""
    simulator = fit.simulation.simulator
    if not simulator.is_continuous_time:
        return simulator
    inner, now = (
        (simulator.simulator, simulator.intersample)
        if isinstance(simulator, ResampledSimulator)
        else (simulator, InterSample.FOH)
    )
    held = {}
    for hold in (now, *(each for each in InterSample if each != now)):
        fine = _fine_enough(inner, hold, fit)
        again = calibrate(_solved(fit.simulation, fine), target, fit.values)
        held[hold] = (again.score, fine)
    best = min(held, key=lambda hold: held[hold][0])
    return held[best if held[best][0] < held[now][0] - BETTER else now][1]


def same_discretisation(one: Simulator, other: Simulator) -> bool:
    """Tell whether two cores are solved in the same way."""
    return _way(one) == _way(other)


def _way(simulator: Simulator) -> tuple[InterSample, int]:
    return (
        (simulator.intersample, simulator.oversampling)
        if isinstance(simulator, ResampledSimulator)
        else (InterSample.FOH, 1)
    )


def _solved(simulation: ExtendedSimulator, simulator: Simulator) -> ExtendedSimulator:
    return replace(simulation, simulator=simulator)


def _fine_enough(inner: Simulator, hold: InterSample, fit: CalibrationResult) -> Simulator:
    """Halve the step until that changes nothing beside what is left over."""
    seen = NOTICED * float(np.sqrt(fit.mean_square))
    times = 1
    coarse = _solved(fit.simulation, ResampledSimulator(inner, hold, times)).simulate(fit.values)
    while times < FINEST:
        finer = _solved(fit.simulation, ResampledSimulator(inner, hold, 2 * times)).simulate(fit.values)
        with np.errstate(over="ignore", invalid="ignore"):
            change = float(np.sqrt(np.mean((finer - coarse) ** 2)))
        if change < seen:
            break
        times, coarse = 2 * times, finer
    return inner if times == 1 and hold == InterSample.FOH else ResampledSimulator(inner, hold, times)
