"""Simulator of a Functional Mock-up Unit, the exchange format of simulation tools."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.errors import RecordError
from islands.expressions.tree import FMU, Apply, Expression, Symbol
from islands.records.channel_names import is_unit, normalise_unit
from islands.records.dataset import Dataset
from islands.simulators.fmu.fmi_description import FmiInterface
from islands.simulators.fmu.fmi_kernel import FmuEquations
from islands.simulators.fmu.instance import LOCAL_FMUS, FmuLane, FmuRun, FmuSource, LoadedFmu
from islands.simulators.fmu.model import FmuModel
from islands.simulators.interface import SimulationRun, peak_amplitude
from islands.simulators.ode.kernel_arguments import LANES
from islands.simulators.ode.lane_simulation import count_samples, list_signals
from islands.simulators.ode.lane_values import LaneInput, LaneValues
from islands.simulators.ode.program import OdeProgram, generate_program
from islands.simulators.ode.sampled_signal import find_channel, make_nominal_context, stack_signals
from islands.simulators.ode.simulator import OdeSimulator
from islands.simulators.ode.system import OdeSystem

#: Numbers of steps of the integrator per sample that are tried until a nominal simulation does not diverge.
STEPS = (1, 2, 4, 8, 16, 32, 64, 128, 256)

#: Largest relative deviation of the sampling time from a multiple of the fixed step of an FMU.
_STEP_ERROR = 1e-6


def simulate_fmu(
    fmu: LoadedFmu,
    model: FmuModel,
    program: OdeProgram,
    start_time: float,
    dt: float,
    lanes: Sequence[LaneInput],
) -> list[FmuRun]:
    """Simulate an FMU and its equations.

    Parameters
    ----------
    fmu : LoadedFmu
        The FMU of the model.
    program : OdeProgram
        Instructions of the equations around the FMU, see `make_fmu_system`.
    start_time, dt : float
        Time of the first sample, and step, in seconds.
    lanes : sequence of LaneInput
        The parameters and initial states by name, and signals with their values at each step. All have the
        same force laws.

    Returns
    -------
    list of FmuRun
        Outputs of the program at the start of each step.
    """
    is_signal = [not (isinstance(signal, Apply) and signal.primitive == FMU) for signal in program.signals]
    signals = _stack_signals(list(itertools.compress(program.signals, is_signal)), dt, lanes)
    values, pack = LaneValues(program, lanes), _make_packer(model, program, np.array(is_signal, dtype=bool))
    inputs = {each.reference: model.symbols[each.name] for each in (model.input, *model.channels)}
    packed = []
    for place, lane in enumerate(lanes):
        given = values.take(np.full(LANES, place))
        equations = pack(arena=given.arena, signals=signals[place], laws=given.laws, limits=given.limits)
        of_inputs = {reference: lane.signals[name] for reference, name in inputs.items()}
        packed.append(FmuLane(_find_start_values(model, lane), of_inputs, equations))
    return fmu.simulate(packed, start_time, dt)


def _find_start_values(model: FmuModel, lane: LaneInput) -> dict[int, float]:
    """Return the start values of variables by value reference."""
    values = {
        parameter.variable.reference: lane.parameters[parameter.variable.name]
        for parameter in model.parameters
    }
    for each in model.initial:
        if each.place < 0:
            values[each.variable.reference] = lane.initial_states[each.variable.name]
    return values


def _stack_signals(
    expressions: Sequence[Expression], dt: float, lanes: Sequence[LaneInput]
) -> list[NDArray[np.float64]]:
    """Return the signals of each lane, shape (steps, 3, signals); lanes with equal ones share the array."""
    found, indices = list_signals(expressions, dt, lanes)
    samples, made = count_samples(lanes), dict[tuple[int, ...], NDArray[np.float64]]()
    for row in map(tuple, indices):
        if row not in made:
            made[row] = stack_signals([found[index] for index in row], samples)
    return [made[tuple(row)] for row in indices]


def _make_packer(
    model: FmuModel, program: OdeProgram, is_signal: NDArray[np.bool_]
) -> Callable[..., FmuEquations]:
    """Return a function that makes the equations of a lane of its values and signals."""
    known = {model.symbols[start.variable.name]: start.place for start in model.initial if start.place >= 0}
    references = {start.variable.name: start.variable.reference for start in model.initial}
    references[model.symbols[model.output.name]] = model.output.reference
    derivatives, values = [], []
    for expression, row in zip(program.signals, program.instructions.signals, strict=True):
        match expression:
            case Apply(function, (Symbol(name),)) if function == FMU and name in known:
                derivatives.append((known[name], row))
            case Apply(function, (Symbol(name),)) if function == FMU:
                values.append((references[name], row))
    # Internal states of force laws follow the states of the FMU.
    following = itertools.count(len(model.description.states))
    places = [known[name] if name in known else next(following) for name in program.states]
    places += [next(following) for _ in program.instructions.slopes[len(places) :]]
    return partial(
        FmuEquations,
        instructions=program.instructions,
        signal_rows=np.array(program.instructions.signals, dtype=np.int64)[is_signal],
        places=np.array(places, dtype=np.int64),
        derivative_places=np.array([place for place, _ in derivatives], dtype=np.int64),
        derivative_rows=np.array([row for _, row in derivatives], dtype=np.int64),
        value_references=np.array([reference for reference, _ in values], dtype=np.uint32),
        value_rows=np.array([row for _, row in values], dtype=np.int64),
    )


@dataclass(frozen=True, slots=True, eq=False)
class FmuSimulator(OdeSimulator):
    """Simulation by an FMU with equations around it, by RK4 if the FMU gives derivatives.

    The FMU is loaded by the process that simulates, so that the simulator can be sent to other processes.

    Attributes
    ----------
    model : FmuModel
    system : OdeSystem
        Equations around the FMU, see `make_fmu_system`.
    initial : mapping
        Nominal states by their names in the equations, and nominal start values by the names of the
        variables, at the first sample.
    source : FmuSource
        Loads the FMU.
    """

    model: FmuModel = field(kw_only=True)
    source: FmuSource = field(default=LOCAL_FMUS, kw_only=True)

    def _list_initial_states(self) -> tuple[Parameter, ...]:
        parameters = []
        for (name, nominal), start in zip(self.initial.items(), self.model.initial, strict=True):
            lower, upper = min(start.variable.lower, nominal), max(start.variable.upper, nominal)
            parameters.append(self._make_initial(name, start.variable.unit, lower, upper))
        return tuple(parameters)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what the simulator is made of, since the functions of its effects cannot be pickled."""
        arguments = self.system, self.initial, self.sizes, self.channels
        model, source = self.model, self.source
        make = partial(FmuSimulator, is_continuous_time=self.is_continuous_time, model=model, source=source)
        return make, arguments

    def run_nominal(self, context: SimulationContext, outputs: tuple[Expression, ...]) -> FmuRun:
        """Simulate expressions of the system at its nominal values; the result says why if it fails."""
        program = generate_program(self.system, outputs)
        run = SimulationRun(np.array([parameter.nominal for parameter in self.parameters]), context.u, {}, ())
        lanes = self._make_lanes(program, (), [run], context)
        dt = context.dt / self._steps
        fmu = self.source.load(self.model.description)
        (found,) = simulate_fmu(fmu, self.model, program, context.start_time, dt, lanes)
        return found

    def _simulate_lanes(
        self,
        program: OdeProgram,
        start_time: float,
        dt: float,
        lanes: Sequence[LaneInput],
        every: int,
    ) -> Signal:
        fmu = self.source.load(self.model.description)
        runs = simulate_fmu(fmu, self.model, program, start_time, dt, lanes)
        return np.stack([run.y for run in runs])[:, :, ::every]


def make_fmu_simulator(
    model: FmuModel, system: OdeSystem, record: Dataset, source: FmuSource = LOCAL_FMUS
) -> FmuSimulator:
    """Make a simulator of an FMU for a record, which determines nominal values at the first sample.

    Parameters
    ----------
    system : OdeSystem
        Equations around the FMU.
    source : FmuSource
        Loads the FMU.

    Raises
    ------
    RecordError
        The record has not the channels, the units or the sampling time of the FMU, or the simulation fails
        or diverges on it.
    ModelError
        The FMU cannot be loaded.
    """
    description, symbols = model.description, model.symbols
    _check_units(model, record)
    _check_sampling_time(model, record.dt)
    channels = {
        symbols[channel.name]: find_channel(channel.name, record, f"{description.name} reads")
        for channel in model.channels
    }
    initial = _find_initial_values(model, record)
    is_integrated = description.interface == FmiInterface.MODEL_EXCHANGE
    # Steps can be shorter than the sampling time.
    is_continuous_time = is_integrated or (description.has_variable_step and description.fixed_step is None)
    states = [name for name, _ in system.derivatives]
    ones = dict.fromkeys([*initial, *(f"d{name}/dt" for name in states)], 1.0)
    rough = FmuSimulator(
        *(system, initial, ones, channels),
        is_continuous_time=is_continuous_time,
        model=model,
        source=source,
    )
    context = make_nominal_context(record)
    values = [start.variable.name for start in model.initial if start.place < 0]
    expressions: list[Expression] = [system.output, *map(Symbol, states)]
    expressions += [right for _, right in system.derivatives]
    expressions += [Apply(FMU, (Symbol(name),)) for name in (*system.of_fmu, *values)]
    steps = STEPS if is_integrated and not system.steps else (system.steps,)
    rough, (output, *signals) = _choose_steps(rough, steps, context, tuple(expressions))
    named = [*states, *(f"d{name}/dt" for name in states)]
    named += [f"{FMU.name}({name})" for name in system.of_fmu] + values
    simulated = dict(zip(named, signals, strict=True))
    sizes = {name: peak_amplitude(signal) for name, signal in simulated.items()}
    peaks = {"input": peak_amplitude(context.u), "output": peak_amplitude(output)}
    pairs = zip(initial, model.initial, strict=True)
    sizes |= {name: peaks[start.sample_of] for name, start in pairs if start.sample_of}
    definitions = tuple(name for name in states if _is_definition(name, states, simulated))
    return replace(rough, system=replace(rough.system, definitions=definitions), sizes=sizes)


def _choose_steps(
    simulator: FmuSimulator,
    steps: Sequence[int],
    context: SimulationContext,
    outputs: tuple[Expression, ...],
) -> tuple[FmuSimulator, Signal]:
    """Return the simulator with the first number of steps at which it does not fail, and its outputs.

    Raises
    ------
    RecordError
        It fails with all of them.
    """
    for count in steps:
        simulator = replace(simulator, system=replace(simulator.system, steps=count))
        found = simulator.run_nominal(context, outputs)
        if np.isfinite(found.y).all():
            return simulator, found.y
    why = f" ({found.failure})" if found.failure else ""
    raise RecordError(
        f"the simulation {simulator.model.description.name} fails or diverges on this input{why}: check its "
        f"parameters and units, and the sampling time {context.dt:g} s"
    )


def _is_definition(name: str, states: Sequence[str], simulated: Mapping[str, Signal]) -> bool:
    """Return whether the derivative of a state that the FMU computes is another state."""
    derivative = simulated[f"{FMU.name}({name})"]
    others = (simulated[other] for other in states if other != name)
    return bool(derivative.any()) and any(np.array_equal(derivative, other) for other in others)


def _find_initial_values(model: FmuModel, record: Dataset) -> dict[str, float]:
    """Return initial values within bounds: first samples of the record, or start values of variables."""
    first = {"input": float(record.u[0, 0]), "output": float(np.nan_to_num(record.y[0]))}
    values = {}
    for each in model.initial:
        variable = each.variable
        name = model.symbols[variable.name] if each.place >= 0 else variable.name
        value = first.get(each.sample_of, variable.start or 0.0)
        values[name] = min(max(value, variable.lower), variable.upper)
    return values


def _check_units(model: FmuModel, record: Dataset) -> None:
    """Compare units that are known; other spellings, such as kg.m2, are not compared."""
    for what, variable, unit in (
        ("input", model.input, record.input_units[0]),
        ("output", model.output, record.output_unit),
    ):
        expected = variable.unit
        if is_unit(expected) and is_unit(unit) and normalise_unit(expected) != normalise_unit(unit):
            raise RecordError(
                f"the {what} {variable.name} of {model.description.name} is in {expected}, that of the "
                f"record in {unit}: convert the column"
            )


def _check_sampling_time(model: FmuModel, dt: float) -> None:
    step = model.description.fixed_step
    if step is None:
        return
    count = round(dt / step)
    if count < 1 or abs(dt - count * step) > _STEP_ERROR * step:
        raise RecordError(
            f"{model.description.name} has a fixed step of {step:g} s, of which the sampling time {dt:g} s "
            "is not a multiple: resample the record, or export the FMU with another step"
        )
