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
from islands.diagnosis.calibration.pattern_search import search_jumps
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.state_equations import (
    get_linear,
    make_fitted_record,
    transfer_linear_values,
)
from islands.diagnosis.inference.pulse_response import convolve, respond_to_pulse
from islands.diagnosis.inference.screening import (
    ScreenedEffect,
    choose_orders,
    list_orders,
    transfer_parameters,
)
from islands.diagnosis.run import DiagnosisRun
from islands.effects.hysteresis import STICTION, is_held
from islands.effects.interface.effect import Effect, Signal, Site, apply_map
from islands.effects.quantiser import QUANTISED_INPUT
from islands.errors import RecordError
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.intersample import InterSample, resample_input
from islands.simulators.linear import estimate_linear

#: Maximum number of cells of the input. A step needs three.
_CELLS = 400

#: Number of values of the input per sample from which the part of the time in a cell is computed.
_FINE = 8

#: Numbers of steps within twice the peak of the input, and offsets relative to the step. At the peak, the
#: levels of successive numbers differ by a twentieth of a step, and by a tenth if they are many.
_COUNTS = np.concatenate([np.arange(2.0, 40.0, 0.1), np.arange(40.0, 100.0, 0.2)])
_OFFSETS = np.arange(-7, 9) / 16.0

#: Breakaway distances of an input that is continuous, relative to its peak. It slips after each of them, so
#: that an error of the distance adds up over a sweep. Closer ones than this are the same.
_BREAKAWAYS, _NEAR_BREAKAWAY = np.geomspace(0.005, 0.6, 1000), 0.02

#: Numbers of steps and offsets near the best ones that are compared then, relative to these. An input that
#: takes all values tells them apart, and one with few levels permits a range.
_NEAR_COUNTS, _NEAR_OFFSETS = np.arange(-10, 11) / 50.0, np.arange(-4, 5) / 64.0

#: Range of the size of a change relative to the expected one: cells that contain an edge reduce it.
_SIZES = (0.6, 1.2)

#: Part of the misfit that values explain before they are calibrated, and how many different ones are.
_MIN_FRACTION, _STARTS = 0.1, 2

#: Maximum number of searches, each with the plant of the one before, and largest mean square relative to it.
_SEARCHES, _MAX_RATIO = 4, 0.99

#: Number of times that the steps of a simulation are halved: an input passes a level between two samples.
_HALVINGS = 3

#: ``(plant, target) -> points``: values of an effect, the best first.
_ListPoints: TypeAlias = Callable[[CalibrationResult, Target], Sequence[Signal]]


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
        The simulation, calibrated to unweighted residuals. It keeps its effects.
    target, run
        Arguments of a search, whose effects are searched for.
    """
    searches = ((QUANTISED_INPUT, _list_steps), (STICTION, _list_breakaways))
    found = [
        _search(effect, base, simulation, target, list_points)
        for effect, list_points in searches
        if effect in run.effects and effect not in base.simulation.effects
        for simulation in list_orders(base, effect)
    ]
    return choose_orders(each for each in found if each is not None)


def _search(
    effect: Effect,
    base: CalibrationResult,
    extended: ExtendedSimulator,
    target: Target,
    list_points: _ListPoints,
) -> ScreenedEffect | None:
    """Return the best fit of an effect in an extended simulation; None if it explains nothing."""
    effects = extended.effects
    before = [each for each in effects[: effects.index(effect)] if each.site == Site.INPUT]
    simulation = _halve_steps(extended)
    plant, best = base, None
    for _ in range(_SEARCHES):
        points = list_points(_apply_maps(plant, before, target), target)
        fits = [_calibrate(plant, simulation, effect, point, target) for point in points]
        found = min(fits, key=lambda fit: fit.mean_square, default=None)
        if found is not None:
            found = search_jumps(found, target)
        if found is None or not found.mean_square < _MAX_RATIO * (best or base).mean_square:
            break
        best = found
        values = transfer_parameters(found.values, simulation, base.simulation)
        plant = evaluate_fit(base.simulation, target, values)
    return None if best is None else ScreenedEffect(effect, best)


def _apply_maps(plant: CalibrationResult, maps: Sequence[Effect], target: Target) -> CalibrationResult:
    """Return the fit of a simulation behind some of its maps of the input, which is their output."""
    if not maps:
        return plant
    simulation, u = plant.simulation, plant.simulation.context.u
    for effect in maps:
        u = apply_map(effect, u, plant.values[simulation.get_slice(effect)], simulation.context)
    others = simulation.with_effects([each for each in simulation.effects if each not in maps])
    behind = replace(others, context=replace(simulation.context, u=u))
    return evaluate_fit(behind, target, transfer_parameters(plant.values, simulation, others))


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
    if linear is None or plant.simulation.effects or target.prior_std or len(context.bounds) > 1:
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
    """Return the breakaway distances that explain most of a residual, different ones."""
    response, context = respond_to_pulse(plant), plant.simulation.context
    if response is None:
        return []
    projection = Projection(plant, target)
    if is_held(context.u):
        distances = np.ravel(STICTION.starting_points(context, target.y - plant.output))
    else:
        distances = _BREAKAWAYS * context.input_peak
    explained = np.zeros(distances.size)
    for place, distance in enumerate(distances.tolist()):
        change = apply_map(STICTION, context.u, np.array([distance]), context) - context.u
        caused = projection(convolve(change, response, context.segments))
        explained[place] = _explain(caused @ projection.residual, caused @ caused)
    least = _MIN_FRACTION * float(projection.residual @ projection.residual)
    found: list[Signal] = []
    for _ in range(_STARTS):
        best = int(np.argmax(explained))
        if not explained[best] > least:
            break
        found.append(distances[best : best + 1])
        explained[np.abs(distances - distances[best]) <= _NEAR_BREAKAWAY * distances[best]] = 0.0
    return found


def _list_steps(plant: CalibrationResult, target: Target) -> list[Signal]:
    """Return steps and offsets that explain most of a residual, those of different steps."""
    response, context = respond_to_pulse(plant), plant.simulation.context
    if response is None:
        return []
    projection, cells = Projection(plant, target), _divide_input(plant, target)
    responses = np.column_stack(
        [projection(convolve(part, response, context.segments)) for part in cells.parts]
    )
    gram, products = responses.T @ responses, responses.T @ projection.residual

    def compare(counts: Signal, offsets: Signal) -> tuple[Signal, Signal, Signal]:
        """Return steps and offsets, their levels in each cell, and the decrease of the sum of squares."""
        steps = np.repeat(2.0 * context.input_peak / counts, offsets.size)
        parts = np.tile(offsets, counts.size)
        places = cells.values / steps[:, None] - parts[:, None]
        levels = np.round(places)
        changes = steps[:, None] * (levels - places)
        explained = _explain(changes @ products, np.sum(changes @ gram * changes, axis=1))
        return np.column_stack([steps, parts * steps]), levels, explained

    points, levels, explained = compare(_COUNTS, _OFFSETS)
    counts = 2.0 * context.input_peak / points[:, 0]
    least = _MIN_FRACTION * float(projection.residual @ projection.residual)
    found: list[Signal] = []
    for _ in range(_STARTS):
        best = int(np.argmax(explained))
        if not explained[best] > least:
            break
        is_same = (levels == levels[best]).all(axis=1)
        near, _, near_explained = compare(
            np.maximum(counts[best] + _NEAR_COUNTS, _COUNTS[0]),
            points[best, 1] / points[best, 0] + _NEAR_OFFSETS,
        )
        found += [points[is_same].mean(axis=0), near[int(np.argmax(near_explained))]]
        explained[is_same | (np.abs(counts - counts[best]) < 1.0)] = 0.0
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
    weights = np.bartlett(2 * fine + 1)[1:-1] / fine
    # One cell after the other: all of them together take hundreds of megabytes.
    return np.array([np.convolve(cells == cell, weights, "same")[::fine] for cell in range(count)])
