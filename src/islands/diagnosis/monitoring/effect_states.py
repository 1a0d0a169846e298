"""States of the effects of a simulation in one record: parameters, scores of further effects, noise."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    estimate_covariance,
    whiten_target,
)
from islands.diagnosis.calibration.preparation import (
    MIN_SAMPLES,
    make_target,
    select_effects,
    validate_prior,
)
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.screening import extend, get_starting_points, transfer_parameters
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect
from islands.effects.scale import wrong_parameter
from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.records.noise_model import NoiseModel
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator

#: Fraction of a response that calibration must leave, so that the effect can be monitored.
MIN_VISIBLE = 0.01


@dataclass(frozen=True, slots=True)
class MonitoredParameter:
    """Parameter of the monitored simulation.

    Attributes
    ----------
    name : str
        Name of the parameter, for an effect after the name of the effect.
    unit : str
    nominal : float
        Value in the diagnosed simulation.
    """

    name: str
    unit: str
    nominal: float


@dataclass(frozen=True, slots=True)
class MonitoredEffect:
    """Response to an effect that the simulation does not have, at one of the effect's starting points.

    Attributes
    ----------
    effect : str
        Name of the effect.
    start : int
        Index of the starting point.
    """

    effect: str
    start: int


@dataclass(frozen=True, slots=True)
class MonitorReference:
    """Quantities of the first record that all records are analysed with.

    Attributes
    ----------
    parameters : tuple of MonitoredParameter
        Parameters of the simulation, without initial states.
    directions : tuple of MonitoredEffect
        Effects that the simulation does not have.
    coefficients, difference_order, variance
        Noise model that whitens residuals, see `NoiseModel`.
    """

    parameters: tuple[MonitoredParameter, ...]
    directions: tuple[MonitoredEffect, ...]
    coefficients: tuple[float, ...]
    difference_order: float
    variance: float

    @property
    def noise(self) -> NoiseModel:
        """Noise model of the first record."""
        coefficients = np.array(self.coefficients)
        return NoiseModel(coefficients, self.variance, 0.0, self.difference_order)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the causes that a change can have: the parameters, then the further effects."""
        return (*(each.name for each in self.parameters), *(each.effect for each in self.directions))


@dataclass(frozen=True, slots=True)
class EffectStates:
    """States of the effects in one record.

    Attributes
    ----------
    values, errors : tuple of float
        Calibrated value of each parameter of the reference, and its standard error.
    scores : tuple of float
        Score of each direction of the reference: the residual in that direction, in standard deviations of
        the noise. Changes of the parameters do not affect it.
    noise : float
        Standard deviation of the innovations of the noise.
    rmse : float
        Root mean square of the residual.
    """

    values: tuple[float, ...]
    errors: tuple[float, ...]
    scores: tuple[float, ...]
    noise: float
    rmse: float

    @property
    def statistics(self) -> Signal:
        """Monitored values: parameters, scores, logarithms of the noise and of the residual's colour."""
        tiny = np.finfo(float).tiny
        noise = float(np.log(max(self.noise, tiny)))
        return np.array([*self.values, *self.scores, noise, float(np.log(max(self.rmse, tiny))) - noise])

    @property
    def statistic_errors(self) -> Signal:
        """Standard errors of `statistics`: those of the parameters, otherwise zero."""
        return np.array([*self.errors, *np.zeros(len(self.scores) + 2)])


@dataclass(frozen=True, slots=True, eq=False)
class RecordAnalysis:
    """Analysis of a record.

    Attributes
    ----------
    states : EffectStates
    changes : ndarray, shape (causes, causes)
        Row j is the change of the parameters and scores if cause j alone changes, up to a factor.
    """

    states: EffectStates
    changes: Signal


def make_reference(record: Dataset, simulator: Simulator, tolerance: Mapping[str, float]) -> MonitorReference:
    """Analyse the first record: its noise model, and the effects that can be monitored.

    Effects at an instant or with a frequency that have to be searched for have no fixed response. They
    change the colour of the residual.

    Raises
    ------
    RecordError
        The record is too short, or the simulation diverges on it.
    SettingsError
        A tolerance belongs to no parameter.
    """
    fit, target = calibrate_record(record, simulator, tolerance, None)
    projection = Projection(fit, target)
    directions = []
    for effect in select_effects(simulator, fit.simulation.context, target.prior_std):
        if effect.extra_degrees_of_freedom:
            continue
        sizes = [
            (float(np.linalg.norm(projected)), start)
            for start in range(_count_starts(fit, effect))
            if float(np.linalg.norm(projected := projection(response := _respond(fit, effect, start))))
            > MIN_VISIBLE * _measure(target, response, fit)
        ]
        if sizes:
            directions.append(MonitoredEffect(effect.name, max(sizes)[1]))
    noise = fit.noise
    return MonitorReference(
        tuple(
            MonitoredParameter(each.name, each.unit, float(each.nominal))
            for each in fit.simulation.parameters
            if not each.initial
        ),
        tuple(directions),
        tuple(map(float, noise.coefficients)),
        float(noise.difference_order),
        float(noise.variance),
    )


def estimate_states(
    record: Dataset, simulator: Simulator, tolerance: Mapping[str, float], reference: MonitorReference
) -> RecordAnalysis:
    """Calibrate the parameters to a record, and compute the scores of the effects of a reference.

    Raises
    ------
    RecordError
        The record is too short, the simulation diverges on it, its input rests, or a channel is missing.
    """
    fit, target = calibrate_record(record, simulator, tolerance, reference.noise)
    is_monitored = np.array([not each.initial for each in fit.simulation.parameters], dtype=bool)
    covariance = estimate_covariance(fit, target)
    effects = _find_effects(fit.simulation, target)
    projection = Projection(fit, target)
    # In standard deviations of the noise of the reference, whatever the residual of this record.
    factor = float(np.std(target.residual(fit.output))) / reference.variance**0.5
    residual = factor * projection.residual
    units, absorbed = [], []
    for direction in reference.directions:
        if direction.effect not in effects:
            raise RecordError(
                f"the record cannot show {direction.effect}, which the first record could: give records "
                "whose input varies"
            )
        response = _respond(fit, effects[direction.effect], direction.start)
        projected = projection(response)
        size = float(np.linalg.norm(projected)) or 1.0
        units.append(projected / size)
        absorbed.append(projection.absorb(response)[is_monitored] / (factor * size))
    columns = np.column_stack(units) if units else np.zeros((residual.size, 0))
    count, directions = int(np.count_nonzero(is_monitored)), len(units)
    changes = np.zeros((count + directions, count + directions))
    changes[:count, :count] = np.eye(count)
    if directions:
        changes[count:, :count] = np.array(absorbed)
        changes[count:, count:] = columns.T @ columns
    states = EffectStates(
        tuple(map(float, fit.values[is_monitored])),
        tuple(map(float, np.sqrt(np.diag(covariance)[is_monitored]))),
        tuple(map(float, columns.T @ residual)),
        float(np.sqrt(fit.noise.variance)),
        float(np.sqrt(fit.mean_square)),
    )
    if not np.isfinite(states.statistics).all() or not np.isfinite(changes).all():
        raise RecordError("the simulation diverges on this record: check its units and its sampling time")
    return RecordAnalysis(states, changes)


def calibrate_record(
    record: Dataset, simulator: Simulator, tolerance: Mapping[str, float], noise: NoiseModel | None
) -> tuple[CalibrationResult, Target]:
    """Calibrate a simulation to a whole record; without a noise model, its residual gives one."""
    known = int(np.count_nonzero(~np.isnan(record.y)))
    if known < MIN_SAMPLES:
        raise RecordError(
            f"the record has {known} measured outputs, and monitoring needs at least {MIN_SAMPLES}: give "
            "longer records"
        )
    prior_std = validate_prior({**simulator.tolerances, **tolerance}, simulator)
    context = make_context(record, simulator, record.samples)
    simulation = ExtendedSimulator(simulator, (), context)
    target = make_target(record, record.samples, prior_std)
    fit = calibrate(simulation, target, simulation.nominal)
    if not np.isfinite(fit.mean_square):
        raise RecordError("the simulation diverges on this record: check its units and its sampling time")
    target = whiten_target(target, fit) if noise is None else replace(target, noise=noise)
    return calibrate(simulation, target, fit.values), target


def _find_effects(simulation: ExtendedSimulator, target: Target) -> dict[str, Effect]:
    """Return the effects that have a response to the input of a record, by name.

    A reference contains effects that its record could show. Another input of the same kind may be too slow to
    distinguish one from others, but it has a response, unless it rests.
    """
    simulator = simulation.simulator
    if simulation.context.has_resting_input:
        found = select_effects(simulator, simulation.context, target.prior_std)
    else:
        wrong = (wrong_parameter(each) for each in simulator.parameters if each.name in target.prior_std)
        found = [*CATALOGUE.values(), *simulator.state_effects, *wrong]
    return {each.name: each for each in found}


def _count_starts(fit: CalibrationResult, effect: Effect) -> int:
    return len(get_starting_points(effect, fit.simulation.with_effects((effect,)), np.zeros(fit.output.size)))


def _respond(fit: CalibrationResult, effect: Effect, start: int) -> Signal:
    """Return the response to an effect at one of its starting points; zero if the simulation diverges."""
    simulation = extend(fit, effect)
    values = transfer_parameters(fit.values, fit.simulation, simulation)
    # A residual of zero: the starting points must be those of all records.
    point = get_starting_points(effect, simulation, np.zeros(fit.output.size))[start]
    values[simulation.get_slice(effect)] = simulation.expand(effect, point)
    response: Signal = simulation.simulate(values) - fit.output
    return response if np.isfinite(response).all() else np.zeros_like(response)


def _measure(target: Target, response: Signal, fit: CalibrationResult) -> float:
    """Return the size of a whitened response, in standard deviations of the whitened residual."""
    sigma = float(np.std(target.residual(fit.output))) or 1.0
    return float(np.linalg.norm(target.select(response))) / sigma
