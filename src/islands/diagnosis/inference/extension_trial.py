"""Trial of an extended simulation: over the intervals of its parameters, and with other inputs.

An effect whose value is uncertain, whose law is wrong, or whose force is stiff may make a simulation diverge
on the next record.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.calibration.intersample_selection import halve_step
from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    estimate_covariance,
    evaluate_fit,
)
from islands.diagnosis.calibration.target import Target
from islands.effects.interface.context import Signal, SimulationContext
from islands.records.dataset import Dataset
from islands.records.signal_ranges import SignalRange, measure_ranges

#: Largest factor of the recorded input with which an extended simulation is tried.
INPUT_FACTOR = 1.2

#: Largest distance of the output from its recorded range, in widths of that range. That of the simulation
#: without effects counts if it is larger.
MAX_EXCURSION = 10.0

#: Largest ratio of the mean squares with smaller steps and without. Values are those of the larger ones.
MAX_STEP_LOSS = 1.05

#: Half width of a confidence interval of 95 % in standard deviations.
_HALF_WIDTH = 1.96


@dataclass(frozen=True, slots=True)
class ExtensionTrial:
    """What is known of an extended simulation beyond its record.

    Attributes
    ----------
    ranges : tuple of SignalRange
        Of the inputs of the record, and of the simulated output.
    input_factor : float
        Largest factor of the recorded input with which it was simulated; 1 if the simulation is known for
        that input alone.
    refusal : str or None
        Why it is not offered, as a sentence; None if it is.
    is_unstable : bool
        Whether it diverges at its values: the law is wrong. At other values they may be uncertain.
    """

    ranges: tuple[SignalRange, ...]
    input_factor: float
    refusal: str | None = None
    is_unstable: bool = False


def refine_extension(
    record: Dataset, base: CalibrationResult, best: CalibrationResult, target: Target
) -> tuple[CalibrationResult, ExtensionTrial]:
    """Try an extension, with smaller steps if it diverges: a force that settles fast may be stiff.

    Parameters
    ----------
    record, base, best, target
        As in `try_extension`.

    Returns
    -------
    CalibrationResult
        The extension that is offered, or ``best`` if none is. All values are those of ``best``.
    ExtensionTrial
    """
    first = trial = try_extension(record, base, best, target)
    fit, simulator = best, halve_step(best.simulation.simulator)
    while trial.refusal is not None and simulator is not None:
        fit = evaluate_fit(replace(best.simulation, simulator=simulator), target, best.values)
        if not fit.mean_square < MAX_STEP_LOSS * best.mean_square:
            break
        trial, simulator = try_extension(record, base, fit, target), halve_step(simulator)
    return (fit, trial) if trial.refusal is None else (best, first)


def try_extension(
    record: Dataset, base: CalibrationResult, best: CalibrationResult, target: Target
) -> ExtensionTrial:
    """Simulate an extension at both ends of each interval of its parameters, and with other inputs.

    They are larger than the recorded one, in the reverse order, and mirrored within its range. The other
    parameters have their most probable values given an end.

    Parameters
    ----------
    record : Dataset
    base, best : CalibrationResult
        The simulation without the extension, and with it.
    target : Target
    """
    simulator = best.simulation.simulator
    # Another input has another output, which was not recorded.
    is_bound = simulator.is_recorded or simulator.fits_states
    labels, points = _list_ends(base, best, target)
    context, refusal, is_unstable = best.simulation.context, None, False
    others = () if is_bound else _list_other_inputs(context)
    for description, u in (("", context.u), *others):
        place = _find_excursion(base, best, points, u, target)
        if place is not None:
            refusal, is_unstable = _describe_refusal(labels[place], description), place == 0
            break
    factor = 1.0 if is_bound else INPUT_FACTOR
    return ExtensionTrial(measure_ranges(record, best.output), factor, refusal, is_unstable)


def _list_other_inputs(context: SimulationContext) -> Iterator[tuple[str, Signal]]:
    """Yield inputs like the recorded one, with their descriptions."""
    u = context.u
    yield f"{INPUT_FACTOR:g} times the recorded input", INPUT_FACTOR * u
    yield (
        "the recorded input in reverse order",
        np.concatenate([u[first:last][::-1] for first, last in context.bounds]),
    )
    yield "the recorded input mirrored within its range", u.min() + u.max() - u


def _list_ends(
    base: CalibrationResult, best: CalibrationResult, target: Target
) -> tuple[list[str], NDArray[np.float64]]:
    """Return the fit, and the points at the ends of the intervals of added parameters, with labels."""
    simulation, covariance = best.simulation, estimate_covariance(best, target)
    labels, points = [""], [best.values]
    for index, name in find_added_parameters(base, best).items():
        deviation = float(np.sqrt(max(covariance[index, index], 0.0)))
        for end in (-_HALF_WIDTH, _HALF_WIDTH) if deviation > 0.0 else ():
            points.append(best.values + end / deviation * covariance[index])
            labels.append(f"{name} = {points[-1][index]:.4g} {simulation.parameters[index].unit}".rstrip())
    return labels, simulation.project(np.array(points))


def find_added_parameters(base: CalibrationResult, best: CalibrationResult) -> dict[int, str]:
    """Return the names of the parameters of terms and effects by their places in the extension."""
    known = {parameter.name for parameter in base.simulation.parameters}
    simulation = best.simulation
    places = [(place, "") for place in range(simulation.simulator_slice.stop)]
    for effect in simulation.effects:
        part = simulation.get_slice(effect)
        places += [(place, f"{effect.name} ") for place in range(part.start, part.stop)]
    found = {place: (prefix, simulation.parameters[place]) for place, prefix in places}
    return {
        place: f"{prefix}{parameter.name.removeprefix(prefix.strip()).strip()}".strip()
        for place, (prefix, parameter) in found.items()
        if not parameter.initial and (prefix or parameter.name not in known)
    }


def _find_excursion(
    base: CalibrationResult, best: CalibrationResult, points: Signal, u: Signal, target: Target
) -> int | None:
    """Return the first point at which the extension diverges or leaves the recorded range by far, or None.

    The simulation without it may do so as well: that is not the extension. Without effects it has the same
    values. Without terms it is another simulation, with its own ones.
    """
    context = replace(best.simulation.context, u=u, intersample_values=None)
    simulation = replace(best.simulation, context=context)
    if simulation.simulator.parameters == base.simulation.simulator.parameters:
        alone = simulation.with_effects(()).simulate_batch(points[:, simulation.simulator_slice])
    else:
        alone = replace(base.simulation, context=context).simulate(base.values)[None, :]
    outputs = simulation.simulate_batch(points)
    low, high = float(np.nanmin(target.y)), float(np.nanmax(target.y))
    reach = MAX_EXCURSION * np.maximum(high - low, np.ptp(alone, axis=1))[:, None]
    is_within = ((outputs >= low - reach) & (outputs <= high + reach)).all(axis=1)
    is_within |= ~np.isfinite(alone).all(axis=1)
    return None if is_within.all() else int(np.argmin(is_within))


def _describe_refusal(label: str, description: str) -> str:
    conditions = [f"{label}, an end of its 95 % interval"] * bool(label) + [description] * bool(description)
    where = f" with {' and '.join(conditions)}," if conditions else ""
    return (
        f"The extended simulation is not offered:{where} it diverges, or its output leaves the "
        f"recorded range by more than {MAX_EXCURSION:g} times its width."
    )
