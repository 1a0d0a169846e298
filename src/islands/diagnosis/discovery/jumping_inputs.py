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

from islands.diagnosis.calibration.intersample_selection import (
    get_discretisation,
    halve_step,
    set_intersample,
)
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate, evaluate_fit
from islands.diagnosis.calibration.pattern_search import search_jumps
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.state_equations import (
    get_linear,
    list_state_fits,
    make_fitted_record,
    transfer_linear_values,
)
from islands.diagnosis.inference.hypothesis import Hypothesis
from islands.diagnosis.inference.pulse_response import convolve, respond_to_pulse
from islands.diagnosis.inference.screening import (
    ScreenedEffect,
    choose_orders,
    compute_cost,
    list_orders,
    transfer_effects,
    transfer_parameters,
)
from islands.diagnosis.run import DiagnosisRun
from islands.effects.hysteresis import BACKLASH, STICTION, is_held, stick
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect, Site, apply_map
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

#: Numbers of steps that are small against a cell, within twice the peak of an input that is continuous.
_SMALL_COUNTS = np.arange(40.0, 300.0, 0.4)

#: Breakaway distances of an input that is continuous, relative to its peak. It slips after each of them, so
#: that an error of the distance adds up over a sweep. Closer ones than this are the same.
_BREAKAWAYS, _NEAR_BREAKAWAY = np.geomspace(0.005, 0.6, 1000), 0.02

#: Breakaway distances that are compared then, relative to the best of these. They are 0.5 % apart.
_NEAR_RATIOS = 1.0 + np.arange(-10, 11) / 2000.0

#: Numbers of steps and offsets near the best ones that are compared then, relative to these. An input that
#: takes all values tells them apart, and one with few levels permits a range.
_NEAR_COUNTS, _NEAR_OFFSETS = np.arange(-10, 11) / 50.0, np.arange(-4, 5) / 64.0

#: Numbers of small steps up to the peak and offsets near the best ones, relative to these and to the step.
_NEAR_LEVELS, _NEAR_PARTS = np.arange(-10, 11) / 100.0, np.arange(-8, 9) / 64.0

#: Range of the size of a change relative to the expected one: cells that contain an edge reduce it.
_SIZES = (0.6, 1.2)

#: Part of the misfit that values explain before they are calibrated, and how many different ones are.
_MIN_FRACTION, _STARTS = 0.1, 2

#: Maximum number of searches, each with the plant of the one before, and largest mean square relative to it.
_SEARCHES, _MAX_RATIO = 4, 0.99

#: Number of times that the steps of a simulation are halved: an input passes a level between two samples.
_HALVINGS = 3

#: Behaviours of an input that changes between samples.
_CONTINUOUS = (InterSample.FOH, InterSample.BAND_LIMITED)

#: ``(plant, target) -> points``: values of an effect, the best first.
_ListPoints: TypeAlias = Callable[[CalibrationResult, Target], Sequence[Signal]]


class _Candidate(NamedTuple):
    """Steps and offsets that are calibrated, and the decrease of the sum of squares."""

    explained: float
    points: tuple[Signal, ...]


class _Cells(NamedTuple):
    """Cells of the input.

    Attributes
    ----------
    values : ndarray, shape (cells,)
        Mean value of the input in each cell.
    places : ndarray of int, shape (times,)
        The cell of each value of its course.
    """

    values: Signal
    places: NDArray[np.int64]


class _InputResponse:
    """Response of a plant to changes of its input, less what its parameters reproduce.

    Parameters
    ----------
    plant : CalibrationResult
    target : Target
    pulse : ndarray
        Response to a pulse, see `respond_to_pulse`.

    Attributes
    ----------
    course : ndarray, shape (fine * samples,)
        The input between samples.
    is_stepwise : bool
        Whether it changes at samples only, so that ``fine`` is one.
    projection : Projection
    """

    def __init__(self, plant: CalibrationResult, target: Target, pulse: Signal) -> None:
        context, simulator = plant.simulation.context, plant.simulation.simulator
        intersample, _ = get_discretisation(simulator)
        is_continuous = simulator.is_continuous_time and intersample != InterSample.ZOH
        self.is_stepwise = not is_continuous or is_held(context.u)
        self._fine = 1 if self.is_stepwise else _FINE
        parts = [context.u[first:last] for first, last in context.bounds]
        if not self.is_stepwise:
            parts = [resample_input(part, intersample, self._fine)[0] for part in parts]
        self.course = np.concatenate(parts)
        self._segments, self._starts = context.segments, [first for first, _ in context.bounds]
        self._direct = 0.0 if self.is_stepwise else _find_direct_term(pulse)
        self._pulse = pulse.copy()
        self._pulse[0] -= self._direct
        self.projection = Projection(plant, target)

    def __call__(self, change: Signal) -> Signal:
        """Return the response to a change with as many values as the course.

        Where the input is linear between samples, a plant that responds at once has its value at each sample,
        and another one its average around it.
        """
        parts = change.reshape(-1, self._fine)
        rising = np.arange(self._fine) / self._fine**2
        before = np.roll(parts @ rising, 1)
        before[self._starts] = parts[self._starts, 0] * rising.sum()
        means = parts @ (1.0 / self._fine - rising) + before
        return self.projection(convolve(means, self._pulse, self._segments) + self._direct * parts[:, 0])

    def explain(self, change: Signal) -> float:
        """Return the decrease of the sum of squares by a change."""
        caused = self(change)
        return float(_explain(caused @ self.projection.residual, caused @ caused))


def _find_direct_term(pulse: Signal) -> float:
    """Return the part of the response to a pulse that follows its input at once.

    The response of a lag to the first half of the pulse is half of that to all of it, and less in a system of
    higher order.
    """
    direct = float(pulse[0] - pulse[1:2].sum() / 2.0)
    return direct if direct * pulse[0] > 0.0 else 0.0


def fit_jumping_inputs(base: CalibrationResult, target: Target, run: DiagnosisRun) -> list[ScreenedEffect]:
    """Return simulations whose actuator moves in jumps, if these explain a part of the misfit.

    Parameters
    ----------
    base : CalibrationResult
        The simulation, calibrated to unweighted residuals. It keeps its effects.
    target, run
        Arguments of a search, whose effects are searched for.
    """
    continuous = _list_equations(base, base, target, [InterSample.FOH])
    plants = [base, *(calibrate(each.simulation, target, each.values) for each in continuous)]
    found = []
    for effect, list_points in ((QUANTISED_INPUT, _list_steps), (STICTION, _list_breakaways)):
        if effect not in run.effects or effect in base.simulation.effects:
            continue
        own = [each for plant in plants for each in _search_orders(effect, plant, target, list_points)]
        if own:
            # The plant behind an actuator is closer to the true one.
            best = min(own, key=lambda each: each.fit.score)
            for plant in _list_equations(best.fit, base, target, _CONTINUOUS):
                own += _search_orders(effect, plant, target, list_points)
        found += own
    return choose_orders(found)


def find_stick_slip(hypothesis: Hypothesis, target: Target, run: DiagnosisRun) -> ScreenedEffect | None:
    """Return stick-slip in place of steps and a play, if that has the lower cost; None otherwise.

    With a play of half a step they are the same: a slider moves by the breakaway distance each time.
    """
    fit, pair = hypothesis.fit, (QUANTISED_INPUT, BACKLASH)
    if not {*pair} <= {*hypothesis.effects} or STICTION not in run.effects:
        return None
    others = [each for each in fit.simulation.effects if each not in pair]
    simulation = fit.simulation.with_effects((*others, STICTION))
    step = fit.values[fit.simulation.get_slice(QUANTISED_INPUT)][:1]
    found = search_jumps(_calibrate(fit, simulation, STICTION, step, target), target)
    is_better = compute_cost(found, fit) < compute_cost(fit, fit)
    return ScreenedEffect(STICTION, found) if is_better else None


def _list_equations(
    fit: CalibrationResult,
    base: CalibrationResult,
    target: Target,
    behaviours: Sequence[InterSample],
) -> list[CalibrationResult]:
    """Return the equations in continuous time of a linear simulation, behind the effects of ``base``.

    Its difference equation reads the input at the samples, and an actuator with a continuous input jumps
    between them. There are none for another simulation or another input. A fit that has such equations has
    them for other behaviours of the input.
    """
    if get_linear(base) is None or is_held(base.simulation.context.u):
        return []
    # The same processes in another order differ by their states only.
    states, known = [fit], [get_discretisation(fit.simulation.simulator)[0]]
    if get_linear(fit) is not None:
        states, known = list_state_fits(fit, target)[:1], []
    found = []
    for each in states:
        for behaviour in (one for one in behaviours if one not in known):
            simulator = set_intersample(each.simulation.simulator, behaviour)
            simulation = replace(each.simulation, simulator=simulator).with_effects(base.simulation.effects)
            values = transfer_parameters(each.values, each.simulation, simulation)
            transfer_effects(fit.values, fit.simulation, values, simulation)
            found.append(evaluate_fit(simulation, target, values))
    return found


def _search_orders(
    effect: Effect, plant: CalibrationResult, target: Target, list_points: _ListPoints
) -> list[ScreenedEffect]:
    """Return the best fits of an effect in front of a plant, in each order of maps."""
    fits = [
        _search(effect, plant, simulation, target, list_points) for simulation in list_orders(plant, effect)
    ]
    return [each for each in fits if each is not None]


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
    pulse, context = respond_to_pulse(plant), plant.simulation.context
    if pulse is None:
        return []
    respond = _InputResponse(plant, target, pulse)

    def explain(distances: Signal) -> Signal:
        """Return the decrease of the sum of squares by each distance."""
        course = respond.course
        return np.array([respond.explain(stick(course, each) - course) for each in distances.tolist()])

    if is_held(context.u):
        distances = np.ravel(STICTION.starting_points(context, target.y - plant.output))
        ratios = np.ones(1)
    else:
        distances, ratios = _BREAKAWAYS * context.input_peak, _NEAR_RATIOS
    explained = explain(distances)
    residual = respond.projection.residual
    least = _MIN_FRACTION * float(residual @ residual)
    found: list[Signal] = []
    for _ in range(_STARTS):
        best = int(np.argmax(explained))
        if not explained[best] > least:
            break
        near = distances[best] * ratios
        found.append(near[[int(np.argmax(explain(near)))]])
        explained[np.abs(distances - distances[best]) <= _NEAR_BREAKAWAY * distances[best]] = 0.0
    return found


def _list_steps(plant: CalibrationResult, target: Target) -> list[Signal]:
    """Return steps and offsets that explain most of a residual, those of different steps."""
    pulse, context = respond_to_pulse(plant), plant.simulation.context
    if pulse is None:
        return []
    respond = _InputResponse(plant, target, pulse)
    found = _compare_levels(respond, context.u[: target.fitted], context.input_peak)
    if not is_held(context.u):
        found += _compare_sawteeth(respond, context.input_peak)
    residual = respond.projection.residual
    least = _MIN_FRACTION * float(residual @ residual)
    found = sorted((each for each in found if each.explained > least), key=lambda each: -each.explained)
    return [point for each in found[:_STARTS] for point in each.points]


def _compare_levels(respond: _InputResponse, u: Signal, peak: float) -> list[_Candidate]:
    """Compare steps and offsets by the levels of each cell of the input."""
    cells = _divide_input(respond, u)
    responses = np.column_stack(
        [respond((cells.places == cell).astype(float)) for cell in range(cells.values.size)]
    )
    gram, products = responses.T @ responses, responses.T @ respond.projection.residual

    def compare(counts: Signal, offsets: Signal) -> tuple[Signal, Signal, Signal]:
        """Return steps and offsets, their levels in each cell, and the decrease of the sum of squares."""
        steps = np.repeat(2.0 * peak / counts, offsets.size)
        parts = np.tile(offsets, counts.size)
        places = cells.values / steps[:, None] - parts[:, None]
        levels = np.round(places)
        changes = steps[:, None] * (levels - places)
        explained = _explain(changes @ products, np.sum(changes @ gram * changes, axis=1))
        return np.column_stack([steps, parts * steps]), levels, explained

    points, levels, explained = compare(_COUNTS, _OFFSETS)
    counts = 2.0 * peak / points[:, 0]
    found = []
    for _ in range(_STARTS):
        best = int(np.argmax(explained))
        is_same = (levels == levels[best]).all(axis=1)
        near, _, near_explained = compare(
            np.maximum(counts[best] + _NEAR_COUNTS, _COUNTS[0]),
            points[best, 1] / points[best, 0] + _NEAR_OFFSETS,
        )
        refined = near[int(np.argmax(near_explained))]
        found.append(_Candidate(float(explained[best]), (points[is_same].mean(axis=0), refined)))
        explained[is_same | (np.abs(counts - counts[best]) < 1.0)] = -np.inf
    return found


def _compare_sawteeth(respond: _InputResponse, peak: float) -> list[_Candidate]:
    """Compare small steps by the first harmonic of the rounding error, a sawtooth over the input.

    Its phase is the offset. The other harmonics contain 39 % of the energy (Widrow and Kollar, Quantization
    Noise, section 4).
    """
    turns = 1j * np.pi / peak * respond.course
    wave, turn = np.exp(turns * _SMALL_COUNTS[0]), np.exp(turns * (_SMALL_COUNTS[1] - _SMALL_COUNTS[0]))
    points, explained = [], []
    for count in _SMALL_COUNTS:
        step = 2.0 * peak / count
        basis = step / np.pi * np.column_stack([respond(wave.imag), respond(wave.real)])
        gram, products = basis.T @ basis, basis.T @ respond.projection.residual
        weights = np.linalg.lstsq(gram, products, rcond=None)[0]
        phase = np.arctan2(weights[1], -weights[0])
        change = np.array([-np.cos(phase), np.sin(phase)])
        points.append((step, phase / (2.0 * np.pi) * step))
        explained.append(float(_explain(change @ products, change @ gram @ change)))
        wave *= turn
    left, found = np.array(explained), []
    for _ in range(_STARTS):
        best = int(np.argmax(left))
        found.append(_refine_step(respond, *points[best]))
        left[np.abs(_SMALL_COUNTS - _SMALL_COUNTS[best]) < 1.0] = -np.inf
    return found


def _refine_step(respond: _InputResponse, step: float, offset: float) -> _Candidate:
    """Return the step and the offset near these whose rounding error explains most."""
    peak = float(np.max(np.abs(respond.course)))
    steps = 1.0 / (1.0 / step + _NEAR_LEVELS / peak)
    points = [np.array([near, offset + part * step]) for near in steps for part in _NEAR_PARTS]
    course, explained = respond.course, []
    for size, place in points:
        rounded = place + size * np.round((course - place) / size)
        explained.append(respond.explain(rounded - course))
    best = int(np.argmax(explained))
    return _Candidate(explained[best], (points[best],))


def _explain(products: Signal, squares: Signal) -> Signal:
    """Return the decrease of a sum of squares by responses, given their products with the residual."""
    sizes = np.clip(products / np.maximum(squares, np.finfo(float).tiny), *_SIZES)
    return (2.0 * products - sizes * squares) * sizes


def _divide_input(respond: _InputResponse, u: Signal) -> _Cells:
    """Divide the range of the input into cells: its values if they are few, else with equal durations."""
    values = np.unique(u)
    if respond.is_stepwise and values.size <= _CELLS:
        edges = (values[1:] + values[:-1]) / 2.0
    else:
        edges = np.unique(np.quantile(u, np.linspace(0.0, 1.0, _CELLS + 1)[1:-1]))
    course, count = respond.course, edges.size + 1
    places = np.searchsorted(edges, course)
    durations = np.maximum(np.bincount(places, minlength=count), 1)
    return _Cells(np.bincount(places, course, count) / durations, places)
