"""Selection of the intersample behaviour and the step size of a simulator, before effects are screened.

Errors of either imitate physics: a wrong intersample behaviour looks like a delay, too coarse a step looks
like damping.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.target import Target
from islands.effects.interface.context import Signal
from islands.effects.timing import DELAY
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import Simulator
from islands.simulators.intersample import InterSample, ResampledSimulator

#: Maximum number of steps per sample.
MAX_OVERSAMPLING = 32

#: Largest accepted RMS change of the output when the step is halved, relative to the RMS of the residual.
MAX_STEP_ERROR = 0.05

#: Largest RMS change of the output by a larger step, relative to that of the residual, with which responses
#: are compared.
MAX_COMPARED_ERROR = 0.25

#: Largest ratio of the changes by two successive halvings of a step, if smaller steps improve the output.
MAX_CHANGE_RATIO = 0.7

#: Least decrease of minus twice the log-likelihood for which another intersample behaviour is selected.
MIN_IMPROVEMENT = 10.0

#: Intersample behaviour, and number of steps in a sample.
Discretisation: TypeAlias = tuple[InterSample, int]


def select_intersample(fit: CalibrationResult, target: Target) -> Simulator:
    """Return the simulator of a fit with the intersample behaviour and the step size that suit the record.

    An output before its input is less probable than a wrong intersample behaviour: a hold is half a sample
    late.
    """
    simulator = fit.simulation.simulator
    if not simulator.is_continuous_time:
        return simulator
    inner, (current, _) = _get_inner(simulator), get_discretisation(simulator)
    tried: dict[InterSample, CalibrationResult] = {}
    irregular = set()
    for intersample in (current, *(each for each in InterSample if each != current)):
        candidate, is_regular = _refine_steps(inner, intersample, fit)
        tried[intersample] = calibrate(_with_simulator(fit.simulation, candidate), target, fit.values)
        if not is_regular:
            irregular.add(intersample)
        # Below the resolution, the scores of right and of almost right outputs do not differ.
        if target.is_matched(tried[intersample].output):
            return candidate
    best = min(tried, key=lambda intersample: tried[intersample].score)
    chosen = best if tried[best].score < tried[current].score - MIN_IMPROVEMENT else current
    if _get_lead(tried[chosen]) > 0.0:
        near = [each for each in tried if tried[each].score < tried[chosen].score + MIN_IMPROVEMENT]
        chosen = min(near, key=lambda intersample: (_get_lead(tried[intersample]), tried[intersample].score))
    found = tried[chosen]
    if chosen in irregular:
        # The changes of the output by dry friction do not decrease regularly with the step.
        found = improve(found, target, _halve_step)
    return found.simulation.simulator


def _get_lead(fit: CalibrationResult) -> float:
    """Return by how much the output of a fit comes before its input."""
    simulation = fit.simulation
    return (
        max(-float(fit.values[simulation.get_slice(DELAY)][0]), 0.0) if DELAY in simulation.effects else 0.0
    )


def improve(
    fit: CalibrationResult,
    target: Target,
    change: Callable[[ExtendedSimulator], ExtendedSimulator | None],
    refit: Callable[[ExtendedSimulator, Target, Signal], CalibrationResult] = calibrate,
) -> CalibrationResult:
    """Fit a simulation that is changed again and again, as long as that explains the record better.

    Parameters
    ----------
    change : callable
        ``simulation -> simulation``; None if there is no further change.
    refit : callable
        ``(simulation, target, values) -> fit``.
    """
    while (changed := change(fit.simulation)) is not None:
        refitted = refit(changed, target, fit.values)
        if not refitted.score < fit.score - MIN_IMPROVEMENT:
            break
        fit = refitted
    return fit


def _halve_step(simulation: ExtendedSimulator) -> ExtendedSimulator | None:
    finer = halve_step(simulation.simulator)
    return None if finer is None else _with_simulator(simulation, finer)


def get_discretisation(simulator: Simulator) -> Discretisation:
    """Return the discretisation of a simulator."""
    return (
        (simulator.intersample, simulator.oversampling)
        if isinstance(simulator, ResampledSimulator)
        else (InterSample.FOH, 1)
    )


def list_other_holds(simulator: Simulator) -> list[Simulator]:
    """Return the simulator with each other intersample behaviour; none in discrete time."""
    current, _ = get_discretisation(simulator)
    return [
        set_intersample(simulator, intersample)
        for intersample in (InterSample if simulator.is_continuous_time else ())
        if intersample != current
    ]


def set_intersample(simulator: Simulator, intersample: InterSample) -> Simulator:
    """Return a simulator in continuous time with another intersample behaviour."""
    _, oversampling = get_discretisation(simulator)
    return ResampledSimulator(_get_inner(simulator), intersample, oversampling)


def halve_step(simulator: Simulator) -> Simulator | None:
    """Return a simulator with twice the number of steps per sample; None if it has no smaller step."""
    intersample, oversampling = get_discretisation(simulator)
    if not simulator.is_continuous_time or oversampling >= MAX_OVERSAMPLING:
        return None
    return ResampledSimulator(_get_inner(simulator), intersample, 2 * oversampling)


def enlarge_step(fit: CalibrationResult) -> CalibrationResult:
    """Return a fit with up to four times its step, as far as that changes its output little.

    Responses that are only compared with one another need no smaller step. The noise, the error and the
    penalty are those of the given fit.
    """
    simulator = fit.simulation.simulator
    intersample, oversampling = get_discretisation(simulator)
    for factor in (4, 2):
        if oversampling % factor == 0:
            larger = ResampledSimulator(_get_inner(simulator), intersample, oversampling // factor)
            simulation = _with_simulator(fit.simulation, larger)
            output = simulation.simulate(fit.values)
            change = float(np.mean((output - fit.output) ** 2))
            if change < MAX_COMPARED_ERROR**2 * fit.mean_square:
                return replace(fit, simulation=simulation, output=output)
    return fit


def _get_inner(simulator: Simulator) -> Simulator:
    return simulator.simulator if isinstance(simulator, ResampledSimulator) else simulator


def _with_simulator(simulation: ExtendedSimulator, simulator: Simulator) -> ExtendedSimulator:
    return replace(simulation, simulator=simulator)


def _refine_steps(
    inner: Simulator, intersample: InterSample, fit: CalibrationResult
) -> tuple[Simulator, bool]:
    """Halve the step until the change of the output is small compared with the residual.

    Changes that do not decrease are no regular error of the integration: the simulation is chaotic, states of
    shooting intervals are at another minimum, or dry friction is smoothed little. The step then remains as it
    is.

    Returns
    -------
    Simulator
    bool
        Whether the changes decrease.
    """
    accepted = MAX_STEP_ERROR * float(np.sqrt(fit.mean_square))
    oversampling, before, is_regular = 1, np.inf, True
    resampled = ResampledSimulator(inner, intersample, oversampling)
    coarse = _with_simulator(fit.simulation, resampled).simulate(fit.values)
    while oversampling < MAX_OVERSAMPLING:
        resampled = ResampledSimulator(inner, intersample, 2 * oversampling)
        fine = _with_simulator(fit.simulation, resampled).simulate(fit.values)
        with np.errstate(over="ignore", invalid="ignore"):
            change = float(np.sqrt(np.mean((fine - coarse) ** 2)))
        if change > MAX_CHANGE_RATIO * before:
            oversampling, is_regular = 1, False
            break
        if change < accepted:
            break
        oversampling, coarse = 2 * oversampling, fine
        before = change if np.isfinite(change) else np.inf
    if oversampling == 1 and intersample == InterSample.FOH:
        return inner, is_regular
    return ResampledSimulator(inner, intersample, oversampling), is_regular
