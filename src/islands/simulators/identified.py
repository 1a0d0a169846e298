"""Identified models in free run: NARX models, to which terms can be added, and all other model classes."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from islands.effects.catalogue import CORE_SHAPE, MODEL_FORM
from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect, Formula, Site
from islands.effects.interface.force import sum_output_forces
from islands.errors import ModelError
from islands.expressions.primitives import MUL, PRIMITIVES, SUB
from islands.expressions.printing import plain
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Shift
from islands.models.block import Block, subtract_offsets
from islands.models.latent import LatentModel
from islands.models.narx import Model, make_model
from islands.models.parametric import ParametricModel
from islands.models.regressor import Regressor, regressor
from islands.records.dataset import Dataset
from islands.simulation.blocks import BlockSimulator
from islands.simulation.initial_states import estimate_first_states
from islands.simulation.linked import LinkedModel
from islands.simulators.interface import (
    BatchSimulator,
    SimulationRun,
    Simulator,
    split_recordings,
)

#: Name of the slope c.
SLOPE = f"{CORE_SHAPE} c"

#: The slope in the text of a term.
_SLOPE_PATTERN = re.compile(r"u2\(k-\d+\)")

#: Largest number of regressors of the lowest degree that are multiplied by a distance.
_MAX_MULTIPLIED = 4

#: Largest number of regressors that are delayed by a sample.
_MAX_DELAYED = 8

#: Typical change of a parameter, relative to its value; of a coefficient of a missing term, relative to the
#: coefficient of the regressor that the term contains.
_SCALE = 0.01

#: Step of a finite difference, relative to the typical change.
_STEP = 0.01

#: Degrees of freedom of the effect in the information criterion, for any number of coefficients. An error in
#: the form of an identified model is likely a priori. The penalty is therefore not larger than that of a
#: second hysteresis with friction, which imitates the effect. It is not smaller either: by chance, each
#: coefficient lowers minus twice the log-likelihood by one.
_DEGREES_OF_FREEDOM = 4

#: Trial values of the slope c, relative to the slope of a regression of the output on the input.
_SLOPES = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8)

#: Number of trial slopes that become starting points.
_STARTING_POINTS = 2

#: Bound of the slope, relative to the ratio of the peaks of output and input.
_MAX_SLOPE = 10.0

#: Singular values below this fraction of the largest one are ignored in the fit of a starting point.
_CUTOFF = 1e-2


@dataclass(frozen=True, slots=True)
class MissingTerm:
    """Term that a model may lack; it is zero where the regressor that it contains is zero.

    Attributes
    ----------
    name : str
        Name of its coefficient.
    regressor : Regressor
        The term; its second input, a constant, is the slope c.
    base_index : int
        Index of the regressor of the model that the term contains.
    has_distance : bool
        Whether the term is that regressor times a distance, which has the unit of the output.
    """

    name: str
    regressor: Regressor
    base_index: int
    has_distance: bool

    def with_slope(self, slope: float) -> Expression:
        """Return the term with a number for the slope."""
        return _insert_slope(self.regressor.expression, slope)


def missing_terms(model: Model, indices: Sequence[int]) -> tuple[MissingTerm, ...]:
    """Return the terms that a model may lack, made of the regressors with the given indices.

    The width of a hysteresis loop depends on the absolute distance of the output from a line over the input,
    which a polynomial in both cannot represent. A delayed regressor may exceed the maximum lag of the search
    that found the model.

    Parameters
    ----------
    model : Model
    indices : sequence of int
        Indices of regressors of the model. Constants are skipped.
    """
    ordered = sorted(
        (place for place in indices if model.regressors[place].lags),
        key=lambda place: (model.regressors[place].degree, model.regressors[place].maximum_lag),
    )
    lowest = model.regressors[ordered[0]].degree if ordered else 0
    simplest = [place for place in ordered if model.regressors[place].degree == lowest][:_MAX_MULTIPLIED]
    psi = {place: model.regressors[place].expression for place in ordered}
    latest, previous = (_make_distance(lag) for lag in (1, 2))
    candidates = [(place, _multiply(psi[place], _take_absolute(latest)), True) for place in simplest]
    candidates += [(place, _multiply(psi[place], _take_absolute(previous)), True) for place in simplest]
    # Models of hysteresis already have the absolute value of the first regressor times levels.
    candidates += [(place, _multiply(_take_absolute(psi[place]), latest), True) for place in simplest[1:]]
    candidates += [(place, Shift(1, psi[place]), False) for place in ordered[:_MAX_DELAYED]]
    known, found = set(model.regressors), []
    for place, expression, has_distance in candidates:
        _, item = regressor(expression)
        if item is not None and item not in known:
            known.add(item)
            text = plain(item.expression, inputs=2).replace("u1(", "u(")
            name = f"{CORE_SHAPE} {_SLOPE_PATTERN.sub('c', text)}"
            found.append(MissingTerm(name, item, place, has_distance))
    return tuple(found)


def _make_distance(lag: int) -> Expression:
    """Return ``y - c u``, delayed by a number of samples."""
    return Apply(SUB, (Lagged(0, lag), _multiply(Lagged(2, lag), Lagged(1, lag))))


def _multiply(*factors: Expression) -> Expression:
    return Apply(MUL, factors)


def _take_absolute(expression: Expression) -> Expression:
    return Apply(PRIMITIVES["abs"], (expression,))


def model_form(simulator: Simulator, model: Model, terms: Sequence[MissingTerm]) -> Effect:
    """Return the effect of a wrong form: the coefficients of the terms that a model lacks, and their slope.

    Parameters
    ----------
    simulator : Simulator
        Simulator of the model; it supports the parameters of the effect by name.
    model : Model
    terms : sequence of MissingTerm
    """
    theta = model.parameters

    def parameters(context: SimulationContext) -> tuple[Parameter, ...]:
        found = []
        for term in terms:
            size = _SCALE * abs(theta[term.base_index]) or _SCALE
            found.append(
                Parameter(term.name, "", 0.0, size / context.output_peak if term.has_distance else size)
            )
        slope = context.output_peak / context.input_peak
        unit = f"{context.output_unit}/{context.input_unit}"
        return (*found, Parameter(SLOPE, unit, slope, 0.02 * slope, -_MAX_SLOPE * slope, _MAX_SLOPE * slope))

    def starting_points(context: SimulationContext, residual: Signal) -> tuple[tuple[float, ...], ...]:
        fitted = round(context.fit_end_time / context.dt)
        own, added = simulator.parameters, parameters(context)[:-1]
        recordings = split_recordings(simulator, context)

        moved = np.vstack([np.zeros(len(own)), _STEP * np.diag([parameter.scale for parameter in own])])
        at_rest, *changed = _simulate_shapes(recordings, moved, [{}] * len(moved))[:, :fitted]
        known = [(output - at_rest) / _STEP for output in changed]
        u = context.u[:fitted]
        regression_slope = float(np.polyfit(u, at_rest, 1)[0])
        trials: list[tuple[float, tuple[float, ...]]] = []
        for factor in _SLOPES:
            slope = factor * regression_slope
            shapes = [{SLOPE: slope, parameter.name: _STEP * parameter.scale} for parameter in added]
            outputs = _simulate_shapes(recordings, np.zeros((len(shapes), len(own))), shapes)[:, :fitted]
            columns = known + [(output - at_rest) / _STEP for output in outputs]
            design = np.column_stack(columns)
            if not np.isfinite(design).all():
                continue
            sizes = np.linalg.norm(design, axis=0) + 1e-300
            solution = np.linalg.lstsq(design / sizes, residual[:fitted], rcond=_CUTOFF)[0] / sizes
            remaining = float(np.sum((residual[:fitted] - design @ solution) ** 2))
            scales = [parameter.scale for parameter in added]
            trials.append((remaining, (*(solution[len(own) :] * scales).tolist(), slope)))
        return tuple(point for _, point in sorted(trials)[:_STARTING_POINTS])

    return Effect(
        name=CORE_SHAPE,
        summary=MODEL_FORM.summary,
        family="shape",
        site=Site.CORE,
        parameters=parameters,
        starting_points=starting_points,
        form=None,
        formula=_write_terms(terms),
        source="Ikhouane and Rodellar, Systems with Hysteresis, section 2; Billings, Nonlinear System "
        "Identification, section 2",
        linear_parameters=len(terms),
        extra_degrees_of_freedom=_DEGREES_OF_FREEDOM - len(terms) - 1,
        is_applicable=lambda context: not context.has_resting_input,
    )


def _write_terms(terms: Sequence[MissingTerm]) -> Formula:
    """Return the formula of terms in the equation of a model, with a number for each coefficient."""
    symbols = tuple(f"k{number}" for number in range(1, len(terms) + 1))
    texts = (re.sub(r"\bc\b", "{c}", each.name.removeprefix(CORE_SHAPE).strip()) for each in terms)
    listed = " + ".join(f"{{{symbol}}}*({text})" for symbol, text in zip(symbols, texts, strict=True))
    return Formula(symbols=(*symbols, "c"), note=f"G contains also {listed}")


def _simulate_shapes(
    recordings: Sequence[tuple[Simulator, SimulationContext]],
    changes: Signal,
    shapes: Sequence[Mapping[str, float]],
) -> Signal:
    """Simulate with each change of the parameters and each shape, (simulations, samples)."""
    outputs = []
    for simulator, part in recordings:
        nominal = np.array([parameter.nominal for parameter in simulator.parameters])
        runs = [
            SimulationRun(nominal + change, part.u, shape, ())
            for change, shape in zip(changes, shapes, strict=True)
        ]
        outputs.append(simulator.simulate_batch(runs, part))
    return np.concatenate(outputs, axis=1)


def _insert_slope(expression: Expression, slope: float) -> Expression:
    match expression:
        case Lagged(2, _):
            return Constant(slope)
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(_insert_slope(argument, slope) for argument in arguments))
    return expression


def _make_parameter(name: str, value: float) -> Parameter:
    return Parameter(name, "", value, _SCALE * abs(value) or _SCALE)


def _make_initial_output(start: Signal) -> Parameter:
    """Return the mean of the initial outputs as a parameter, since their measured samples have noise."""
    scale = _SCALE * float(np.max(np.abs(start))) or _SCALE
    return Parameter("initial output", "", float(start.mean()), scale, initial=True)


@dataclass(frozen=True, slots=True, eq=False)
class NarxSimulator(BatchSimulator):
    """Free run of a model, started from the first measured samples; its parameters are calibrated.

    Parameters of terms with a single factor that reads the output alone, such as y(k-1), are fixed, so that a
    constraint on them, such as a sum of one, remains satisfied. An effect on the output is added after the
    model; inside a model whose coefficients of the output sum to one, it would be integrated.

    Attributes
    ----------
    model : Model
    name : str
    start : ndarray, shape (maximum lag,) or longer
        Measured output; the free run starts from its first samples.
    """

    model: Model
    name: str = field()  # without it, the property of the base class would be the default
    start: Signal
    sites: ClassVar[frozenset[Site]] = frozenset((Site.INPUT, Site.FORCE, Site.OUTPUT))
    state_effects: tuple[Effect, ...] = field(init=False)
    _calibrated: NDArray[np.int64] = field(init=False, repr=False)
    _theta: Signal = field(init=False, repr=False)
    _linked: LinkedModel = field(init=False, repr=False)
    _missing: tuple[MissingTerm, ...] = field(init=False, repr=False)
    _extended: LinkedModel = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.model.inputs != 1:
            raise ModelError(
                f"{self.name} has {self.model.inputs} inputs: a diagnosis takes models of one input"
            )
        calibrated = [
            place for place, item in enumerate(self.model.regressors) if not _is_linear_in_output(item)
        ]
        object.__setattr__(self, "_calibrated", np.array(calibrated, dtype=np.int64))
        object.__setattr__(self, "_theta", np.array(self.model.parameters))
        object.__setattr__(self, "_linked", LinkedModel(self.model.regressors))
        missing = missing_terms(self.model, calibrated)
        further = tuple(term.regressor for term in missing)
        object.__setattr__(self, "_missing", missing)
        object.__setattr__(self, "_extended", LinkedModel((*self.model.regressors, *further)))
        object.__setattr__(self, "state_effects", (model_form(self, self.model, missing),) if missing else ())

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the terms that are not fixed, and mean of the initial outputs.

        The initial outputs are measured. A model that holds its output at a constant input would keep their
        noise as an offset.
        """
        theta = self.model.parameters
        start = self.start[: self._linked.warm_up]
        return (
            *(_make_parameter(f"theta{place + 1}", theta[place]) for place in self._calibrated),
            _make_initial_output(start),
        )

    def for_samples(self, first: int, last: int) -> "NarxSimulator":
        """Return the free run from the first measured outputs of one recording."""
        return replace(self, start=self.start[first:last])

    def with_values(self, values: Signal) -> Model:
        """Return the model with the given values of its calibrated parameters."""
        theta = list(self.model.parameters)
        for place, value in zip(self._calibrated, values[:-1], strict=True):
            theta[place] = float(value)
        return replace(self.model, theta=tuple(theta))

    def with_shape(self, values: Signal, shape: Mapping[str, float]) -> Model:
        """Return the model with given values, and missing terms with the coefficients in ``shape``."""
        model = self.with_values(values)
        known = zip(model.regressors, model.parameters, strict=True)
        terms = [(item.expression, parameter) for item, parameter in known]
        terms += [(term.with_slope(shape[SLOPE]), shape[term.name]) for term in self._missing]
        return make_model(terms, model.input_names, model.output_name, model.dt)

    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate several runs; see `Simulator.simulate_batch`."""
        theta = np.tile(self._theta, (len(runs), 1))
        theta[:, self._calibrated] = [run.values[:-1] for run in runs]
        warm_up = self._linked.warm_up
        measured = self.start[:warm_up]
        levels = np.array([[run.values[-1]] for run in runs])
        start = measured + (levels - measured.mean())
        if SLOPE in runs[0].effect_parameters:
            simulated = self._run_extended(theta, runs, start)
        else:
            inputs = {id(run.x): run.x[None] for run in runs}
            simulated = self._linked.free_runs(theta, [inputs[id(run.x)] for run in runs], start)
        simulated[:, :warm_up] = start
        if any(run.forces for run in runs):
            simulated += sum_output_forces([run.x for run in runs], context, [run.forces for run in runs])
        return simulated[:, ::every]

    def _run_extended(self, theta: Signal, runs: Sequence[SimulationRun], start: Signal) -> Signal:
        """Run the model with the missing terms; signals are constant before the first sample."""
        missing = [[run.effect_parameters.get(term.name, 0.0) for term in self._missing] for run in runs]
        before = self._extended.warm_up - start.shape[1]
        inputs, channels = [], dict[tuple[int, float], Signal]()
        for run in runs:
            key = id(run.x), run.effect_parameters[SLOPE]
            if key not in channels:
                padded = np.concatenate([np.full(before, run.x[0]), run.x])
                channels[key] = np.stack([padded, np.full_like(padded, key[1])])
            inputs.append(channels[key])
        first = start[:, :1] if start.shape[1] else np.zeros((len(runs), 1))
        initial = np.hstack([np.repeat(first, before, axis=1), start])
        return self._extended.free_runs(np.hstack([theta, missing]), inputs, initial)[:, before:]


def _is_linear_in_output(item: Regressor) -> bool:
    return item.lags != frozenset() and {channel for channel, _ in item.lags} == {0} and item.degree == 1


@dataclass(frozen=True, slots=True, eq=False)
class ParametricSimulator(BatchSimulator):
    """Free run of a model, started from the first measured samples; all of its parameters are calibrated.

    Attributes
    ----------
    model : ParametricModel
    name : str
    record : Dataset
        Record whose first input drives the model, with a complete output; the free run starts from its first
        samples.
    parameters : tuple of Parameter
        Parameters of the model, and the start of the free run: the states of a latent model at the first
        sample, which are estimated as for `free_run`; the mean of the initial outputs of other models.

    Raises
    ------
    ModelError
        The model has several inputs.
    """

    model: ParametricModel
    name: str = field()  # without it, the property of the base class would be the default
    record: Dataset
    parameters: tuple[Parameter, ...] = field(init=False)
    sites: ClassVar[frozenset[Site]] = frozenset((Site.INPUT, Site.FORCE, Site.OUTPUT))
    _block: Block = field(init=False, repr=False)
    _warm_up: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.model.inputs != 1:
            raise ModelError(
                f"{self.name} has {self.model.inputs} inputs: a diagnosis takes models of one input"
            )
        block = subtract_offsets(self.model.block(), self.model.preprocessing)
        found = list(map(_make_parameter, self.model.names, self.model.parameters))
        warm_up = block.maximum_lag
        if isinstance(self.model, LatentModel):
            first, late = self._estimate_states(self.model)
            states = {f"initial {name}": value for name, value in zip(self.model.states, first, strict=True)}
            found += [Parameter(name, "", value, _SCALE, initial=True) for name, value in states.items()]
            block, warm_up = block.start_at(states), 1 + late
        else:
            found.append(_make_initial_output(self.record.y[:warm_up]))
        for name, value in (("parameters", tuple(found)), ("_block", block), ("_warm_up", warm_up)):
            object.__setattr__(self, name, value)

    def _estimate_states(self, model: LatentModel) -> tuple[list[float], int]:
        """Estimate the states at the first sample whose input is known; return them and this sample."""
        signals, done = self.record.first_inputs(1), model.preprocessing
        if done is not None:
            u = signals.u - np.array(done.input_offsets)
            signals = replace(signals, u=u, **signals.change_outputs(lambda y: y - done.output_offset))
        end = min(model.memory, signals.samples)
        states, u = estimate_first_states(model, signals, 0, end)
        return states.tolist(), end - len(u)

    def for_samples(self, first: int, last: int) -> "ParametricSimulator":
        """Return the free run from the first samples of one recording."""
        return replace(self, record=self.record[first:last])

    def with_values(self, values: Signal) -> ParametricModel:
        """Return the model with the given values of its parameters."""
        return self.model.with_parameters(values[: self.model.size].tolist())

    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate several runs; see `Simulator.simulate_batch`."""
        simulated: NDArray[np.float64] = np.empty((len(runs), runs[0].x.size))
        count = len(self._block.parameters)
        groups: dict[tuple[int, tuple[float, ...]], list[int]] = {}
        for place, run in enumerate(runs):
            groups.setdefault((id(run.x), tuple(run.values[count:].tolist())), []).append(place)
        for (_, level), places in groups.items():
            parameters = np.array([runs[place].values[:count] for place in places])
            simulated[places] = self._simulate(runs[places[0]].x, level, parameters)
        if any(run.forces for run in runs):
            simulated += sum_output_forces([run.x for run in runs], context, [run.forces for run in runs])
        return simulated[:, ::every]

    def _simulate(
        self, x: Signal, level: Sequence[float], parameters: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Simulate an input with several sets of parameters.

        ``level`` has the mean of the initial outputs; it is empty if the states are parameters.
        """
        warm_up = self._warm_up
        measured = self.record.y[:warm_up]
        outputs = np.full((1, x.size), np.nan)
        outputs[0, :warm_up] = measured + (level[0] - measured.mean() if level else 0.0)
        start, length = np.array([warm_up]), np.array([x.size - warm_up])
        simulate = BlockSimulator(self._block, outputs, x[None], start, length, warm_up)
        found = simulate(parameters)[:, 0]
        found[:, :warm_up] = outputs[0, :warm_up]
        return found
