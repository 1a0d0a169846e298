"""Search for an actuator that moves in jumps: it rounds its command to steps, or sticks.

The error of a simulation is no smooth function of a step or of a breakaway distance, so that a calibration
finds them from nearby values alone. To first order, the residual is the response of the plant to what the
actuator changes. This tells the best of many values without a calibration. The plant is then estimated again
behind the actuator, since without it another one may fit better.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.calibration.intersample_selection import get_discretisation, halve_step
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate, evaluate_fit
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.state_equations import (
    get_linear,
    make_fitted_record,
    transfer_linear_values,
)
from islands.diagnosis.inference.pulse_response import convolve, respond_to_pulse
from islands.diagnosis.inference.screening import ScreenedEffect, transfer_parameters
from islands.diagnosis.run import DiagnosisRun
from islands.effects.hysteresis import STICTION
from islands.effects.interface.effect import Effect, Signal, apply_map
from islands.effects.quantiser import QUANTISED_INPUT
from islands.errors import RecordError
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.intersample import InterSample, resample_input
from islands.simulators.linear import estimate_linear

#: Maximum number of cells of the input. A step needs three.
_CELLS = 120

#: Number of values of the input per sample from which the part of the time in a cell is computed.
_FINE = 8

#: Numbers of steps within twice the peak of the input, and offsets relative to the step. At the peak, the
#: levels of successive numbers differ by a twentieth of a step.
_COUNTS, _OFFSETS = np.arange(2.0, 40.0, 0.1), np.arange(-7, 9) / 16.0

#: Range of the size of a change relative to the expected one: cells that contain an edge reduce it.
_SIZES = (0.6, 1.2)

#: Part of the misfit that values explain before they are calibrated, and how many are calibrated.
_MIN_FRACTION, _STARTS = 0.1, 2

#: Maximum number of searches, each with the plant of the one before, and largest mean square relative to it.
_SEARCHES, _MAX_RATIO = 4, 0.99

#: Number of times that the steps of a simulation are halved: an input passes a level between two samples.
_HALVINGS = 3

#: ``plant -> points``: values of an effect, the best first.
_ListPoints: TypeAlias = Callable[[CalibrationResult], Sequence[Signal]]


class _Cells(NamedTuple):
    """Cells of the input.

    Attributes
    ----------
    values : ndarray, shape (cells,)
        Mean value of the input in each cell.
    parts : ndarray, shape (cells, samples)
        Part of the time around each sample in which the input is in a cell.
    """

    values: Signal
    parts: Signal


def fit_jumping_inputs(base: CalibrationResult, target: Target, run: DiagnosisRun) -> list[ScreenedEffect]:
    """Return simulations whose actuator moves in jumps, if these explain a part of the misfit.

    Parameters
    ----------
    base : CalibrationResult
        The simulation without effects, calibrated to unweighted residuals.
    target, run
        Arguments of a search, whose effects are searched for.
    """
    found = []
    if QUANTISED_INPUT in run.effects:
        cells = _divide_input(base, target)
        found.append(_search(QUANTISED_INPUT, base, target, lambda plant: _list_steps(cells, plant, target)))
    if STICTION in run.effects:
        found.append(_search(STICTION, base, target, lambda plant: _list_breakaways(plant, target)))
    return [each for each in found if each is not None]


def _search(
    effect: Effect, base: CalibrationResult, target: Target, list_points: _ListPoints
) -> ScreenedEffect | None:
    """Return the best fit of an effect; None if it explains nothing."""
    simulation = _halve_steps(base.simulation).with_effects((effect,))
    plant, best = base, None
    for _ in range(_SEARCHES):
        fits = [_calibrate(plant, simulation, effect, point, target) for point in list_points(plant)]
        found = min(fits, key=lambda fit: fit.mean_square, default=None)
        if found is None or not found.mean_square < _MAX_RATIO * (best or base).mean_square:
            break
        best = found
        values = transfer_parameters(found.values, simulation, base.simulation)
        plant = evaluate_fit(base.simulation, target, values)
    return None if best is None else ScreenedEffect(effect, best)


def _halve_steps(simulation: ExtendedSimulator) -> ExtendedSimulator:
    simulator = simulation.simulator
    for _ in range(_HALVINGS):
        simulator = halve_step(simulator) or simulator
    return replace(simulation, simulator=simulator)


def _calibrate(
    plant: CalibrationResult, simulation: ExtendedSimulator, effect: Effect, point: Signal, target: Target
) -> CalibrationResult:
    """Calibrate the plant behind an actuator with the given values, then all values.

    The gain of the plant makes up for a wrong step, so that both would move together at first.
    """
    start = transfer_parameters(plant.values, plant.simulation, simulation)
    part = simulation.get_slice(effect)
    start[part] = point
    is_fixed = np.zeros(start.size, dtype=np.bool_)
    is_fixed[part] = True
    starts = [start, *_estimate_plant(plant, effect, start, part, target)]
    fits = [calibrate(simulation, target, each, is_fixed=is_fixed) for each in starts]
    found = min(fits, key=lambda fit: fit.mean_square)
    return calibrate(simulation, target, found.values)


def _estimate_plant(
    plant: CalibrationResult, effect: Effect, start: Signal, part: slice, target: Target
) -> list[Signal]:
    """Return values with those of a linear model of the output over the input after an effect, if any."""
    linear, context = get_linear(plant), plant.simulation.context
    if linear is None or target.prior_std or len(context.bounds) > 1:
        return []
    record = make_fitted_record(context, target)
    moved = apply_map(effect, context.u, start[part], context)[: record.samples]
    try:
        found = estimate_linear(linear.denominator.size, linear.delay, replace(record, u=moved[:, None]))
    except RecordError:  # It is too short for a linear model.
        return []
    values = start.copy()
    values[: len(linear.parameters)] = transfer_linear_values(found, linear)
    return [values]


def _list_breakaways(plant: CalibrationResult, target: Target) -> list[Signal]:
    """Return the breakaway distances that explain most of a residual."""
    response, context = respond_to_pulse(plant), plant.simulation.context
    if response is None:
        return []
    projection = Projection(plant, target)
    points = STICTION.starting_points(context, target.y - plant.output)
    changes = [apply_map(STICTION, context.u, np.array(point), context) - context.u for point in points]
    responses = np.array([projection(convolve(each, response, context.segments)) for each in changes])
    explained = _explain(responses @ projection.residual, np.sum(responses**2, axis=1))
    order = np.argsort(-explained)[:_STARTS]
    least = _MIN_FRACTION * float(projection.residual @ projection.residual)
    return [np.array(points[place]) for place in order if explained[place] > least]


def _list_steps(cells: _Cells, plant: CalibrationResult, target: Target) -> list[Signal]:
    """Return steps and offsets that explain most of a residual, those of different steps."""
    response, context = respond_to_pulse(plant), plant.simulation.context
    if response is None:
        return []
    projection = Projection(plant, target)
    responses = np.column_stack(
        [projection(convolve(part, response, context.segments)) for part in cells.parts]
    )
    steps = np.repeat(2.0 * context.input_peak / _COUNTS, _OFFSETS.size)
    offsets = np.tile(_OFFSETS, _COUNTS.size) * steps
    places = (cells.values - offsets[:, None]) / steps[:, None]
    levels = np.round(places)
    changes = steps[:, None] * (levels - places)
    squares = np.einsum("ij,ij->i", changes @ (responses.T @ responses), changes)
    explained = _explain(changes @ (responses.T @ projection.residual), squares)
    least = _MIN_FRACTION * float(projection.residual @ projection.residual)
    found: list[Signal] = []
    while len(found) < _STARTS and explained.max() > least:
        best = int(np.argmax(explained))
        is_same = (levels == levels[best]).all(axis=1)
        found.append(np.array([steps[is_same].mean(), offsets[is_same].mean()]))
        is_near = np.abs(context.input_peak / steps - context.input_peak / steps[best]) < 0.5
        explained[is_near | is_same] = 0.0
    return found


def _explain(products: Signal, squares: Signal) -> Signal:
    """Return the decrease of a sum of squares by responses, given their products with the residual."""
    sizes = np.clip(products / np.maximum(squares, np.finfo(float).tiny), *_SIZES)
    return (2.0 * products - sizes * squares) * sizes


def _divide_input(fit: CalibrationResult, target: Target) -> _Cells:
    """Divide the range of the input into cells: its values if they are few, else with equal durations."""
    context, simulator = fit.simulation.context, fit.simulation.simulator
    values = np.unique(context.u[: target.fitted])
    intersample, _ = get_discretisation(simulator)
    fine = _FINE if simulator.is_continuous_time and intersample != InterSample.ZOH else 1
    if values.size <= _CELLS:
        fine, edges = 1, (values[1:] + values[:-1]) / 2.0
    else:
        edges = np.unique(np.quantile(context.u[: target.fitted], np.linspace(0.0, 1.0, _CELLS + 1)[1:-1]))
    signals = [
        resample_input(context.u[first:last], intersample, fine)[0] if fine > 1 else context.u[first:last]
        for first, last in context.bounds
    ]
    cells = [np.searchsorted(edges, signal) for signal in signals]
    joined, places = np.concatenate(signals), np.concatenate(cells)
    counts = np.bincount(places, minlength=edges.size + 1)
    means = np.bincount(places, joined, edges.size + 1) / np.maximum(counts, 1)
    return _Cells(means, np.concatenate([_average(each, edges.size + 1, fine) for each in cells], axis=1))


def _average(cells: NDArray[np.int64], count: int, fine: int) -> Signal:
    """Return the part of the time around each sample in each cell: an input is linear between samples."""
    is_in = (cells == np.arange(count)[:, None]).astype(np.float64)
    if fine == 1:
        return is_in
    weights = np.bartlett(2 * fine + 1)[1:-1] / fine
    return np.array([np.convolve(each, weights, "same")[::fine] for each in is_in])
