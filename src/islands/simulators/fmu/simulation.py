"""Simulation of an FMU with the equations around it, for one set of values."""

import itertools

import numpy as np

from islands.expressions.tree import FMU, Apply, Symbol
from islands.simulators.fmu.fmi_kernel import FmuEquations
from islands.simulators.fmu.instance import FmuRun
from islands.simulators.fmu.model import FmuModel
from islands.simulators.fmu.source import LoadedFmu
from islands.simulators.ode.kernel_arguments import LANES
from islands.simulators.ode.lane_simulation import pack_signals
from islands.simulators.ode.lane_values import LaneInput, LaneValues
from islands.simulators.ode.program import OdeProgram


def simulate_fmu(
    fmu: LoadedFmu, model: FmuModel, program: OdeProgram, start_time: float, dt: float, lane: LaneInput
) -> FmuRun:
    """Simulate an FMU and its equations.

    Parameters
    ----------
    fmu : LoadedFmu
        The FMU of the model.
    program : OdeProgram
        Instructions of the equations around the FMU, see `make_fmu_system`.
    start_time, dt : float
        Time of the first sample, and step, in seconds.
    lane : LaneInput
        The parameters and initial states by name, and signals with their values at each step.

    Returns
    -------
    FmuRun
        Outputs of the program at the start of each step.
    """
    start_values = {each.variable.reference: lane.parameters[each.variable.name] for each in model.parameters}
    for each in model.initial:
        if each.place < 0:
            start_values[each.variable.reference] = lane.initial_states[each.variable.name]
    inputs = {
        each.reference: lane.signals[model.symbols[each.name]] for each in (model.input, *model.channels)
    }
    equations = _pack_equations(model, program, dt, lane)
    return fmu.simulate(start_values, inputs, equations, start_time, dt)


def _pack_equations(model: FmuModel, program: OdeProgram, dt: float, lane: LaneInput) -> FmuEquations:
    known = {model.symbols[each.variable.name]: each.place for each in model.initial if each.place >= 0}
    references = {each.variable.name: each.variable.reference for each in model.initial}
    references[model.symbols[model.output.name]] = model.output.reference
    rows = dict(zip(program.signals, program.instructions.signals, strict=True))
    derivatives, values, signals = [], [], []
    for expression, row in rows.items():
        match expression:
            case Apply(function, (Symbol(name),)) if function == FMU and name in known:
                derivatives.append((known[name], row))
            case Apply(function, (Symbol(name),)) if function == FMU:
                values.append((references[name], row))
            case _:
                signals.append(expression)
    given = LaneValues(program, [lane]).take(np.zeros(LANES, dtype=np.int64))
    found, order = pack_signals(signals, dt, [lane])
    # Internal states of force laws follow the states of the FMU.
    following = itertools.count(len(model.description.states))
    places = [known[name] if name in known else next(following) for name in program.states]
    places += [next(following) for _ in program.instructions.slopes[len(places) :]]
    return FmuEquations(
        program.instructions,
        given.arena,
        found.shared,
        np.array([rows[signals[place]] for place in order], dtype=np.int64),
        given.laws,
        given.limits,
        np.array(places, dtype=np.int64),
        np.array([place for place, _ in derivatives], dtype=np.int64),
        np.array([row for _, row in derivatives], dtype=np.int64),
        np.array([reference for reference, _ in values], dtype=np.uint32),
        np.array([row for _, row in values], dtype=np.int64),
    )
