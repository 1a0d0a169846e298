"""Simulation of an FMU with the equations around it, for several sets of values."""

import itertools
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from islands.expressions.tree import FMU, Apply, Expression, Symbol
from islands.simulators.fmu.fmi_kernel import FmuEquations
from islands.simulators.fmu.instance import FmuLane, FmuRun
from islands.simulators.fmu.model import FmuModel
from islands.simulators.fmu.source import LoadedFmu
from islands.simulators.ode.kernel_arguments import LANES
from islands.simulators.ode.lane_simulation import count_samples, list_signals
from islands.simulators.ode.lane_values import LaneInput, LaneValues
from islands.simulators.ode.program import OdeProgram
from islands.simulators.ode.sampled_signal import stack_signals


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
    is_signal = [not (isinstance(each, Apply) and each.primitive == FMU) for each in program.signals]
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
    values = {each.variable.reference: lane.parameters[each.variable.name] for each in model.parameters}
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
    known = {model.symbols[each.variable.name]: each.place for each in model.initial if each.place >= 0}
    references = {each.variable.name: each.variable.reference for each in model.initial}
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
