"""Trial of an extended simulation: over the intervals of its parameters, and with a larger input.

An effect whose value is uncertain, or whose force is stiff, may make a simulation diverge on the next record.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.data.signal_ranges import SignalRange, measure_ranges
from islands.diagnosis.calibration.intersample_selection import halve_step
from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    estimate_covariance,
    evaluate_fit,
)
from islands.diagnosis.calibration.target import Target
from islands.effects.interface.effect import Signal
from islands.simulators.extended import ExtendedSimulator

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
    """

    ranges: tuple[SignalRange, ...]
    input_factor: float
    refusal: str | None = None


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
    """Simulate an extension at both ends of each interval of its parameters, and with a larger input.

    The other parameters have their most probable values given that end.

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
    factors = (1.0,) if is_bound else (1.0, INPUT_FACTOR)
    labels, points = _list_ends(base, best, target)
    refusal = None
    for factor in factors:
        place = _find_excursion(best, points, factor, target)
        if place is not None:
            refusal = _describe_refusal(labels[place], factor)
            break
    return ExtensionTrial(measure_ranges(record, best.output), factors[-1], refusal)


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


def _find_excursion(best: CalibrationResult, points: Signal, factor: float, target: Target) -> int | None:
    """Return the first point at which the extension diverges or leaves the recorded range by far, or None.

    The simulation with the same values, but without effects, may do so as well: that is not the extension.
    """
    simulation = _scale_input(best, factor)
    alone = simulation.with_effects(()).simulate_batch(points[:, simulation.simulator_slice])
    outputs = simulation.simulate_batch(points)
    low, high = float(np.nanmin(target.y)), float(np.nanmax(target.y))
    reach = MAX_EXCURSION * np.maximum(high - low, np.ptp(alone, axis=1))[:, None]
    is_within = ((outputs >= low - reach) & (outputs <= high + reach)).all(axis=1)
    is_within |= ~np.isfinite(alone).all(axis=1)
    return None if is_within.all() else int(np.argmin(is_within))


def _scale_input(fit: CalibrationResult, factor: float) -> ExtendedSimulator:
    """Return the simulation of a fit with a multiple of its input."""
    context = fit.simulation.context
    between = None if context.intersample_values is None else factor * context.intersample_values
    return replace(fit.simulation, context=replace(context, u=factor * context.u, intersample_values=between))


def _describe_refusal(label: str, factor: float) -> str:
    at = f" with {label}, an end of its 95 % interval" if label else ""
    larger = f" {'and' if at else 'with'} {factor:g} times the recorded input" if factor != 1.0 else ""
    where = f"{at}{larger}," if label or larger else ""
    return (
        f"The extended simulation is not offered:{where} it diverges, or its output leaves the "
        f"recorded range by more than {MAX_EXCURSION:g} times its width."
    )
