"""Differential equations in place of a linear simulation: terms and limits then act inside of the plant."""

from dataclasses import replace
from math import ceil

import numpy as np

from islands.diagnosis.calibration.intersample_selection import select_intersample
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate, evaluate_fit
from islands.diagnosis.calibration.target import Target
from islands.effects.interface.context import Signal, SimulationContext
from islands.errors import RecordError
from islands.expressions.tree import Symbol
from islands.records.dataset import Dataset
from islands.records.segments import fill_gaps
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import peak_amplitude
from islands.simulators.intersample import InterSample, ResampledSimulator
from islands.simulators.linear import LinearSimulator, estimate_linear
from islands.simulators.linear_states import LinearStates, approximate_cascade, list_states
from islands.simulators.ode.simulator import OdeSimulator
from islands.simulators.output_equation import OutputEquation

#: Longest step of a simulation before its step is selected, relative to the fastest time constant.
_LONGEST_STEP = 1.0


def list_state_fits(fit: CalibrationResult, target: Target) -> list[CalibrationResult]:
    """Return the differential equations that simulate what a linear simulation does, without its effects.

    Parameters
    ----------
    fit : CalibrationResult
        A calibrated simulation.
    target : Target

    Returns
    -------
    list of CalibrationResult
        An oscillator, or one for each order of its processes, not calibrated; none if it is another
        simulation, or has no such equations.
    """
    linear = get_linear(fit)
    if linear is None:
        return []
    bare, values = fit.simulation.with_effects(()), fit.values[fit.simulation.simulator_slice]
    output = bare.simulate(values)
    states = list_states(linear, values[: len(linear.parameters)], bare.context.dt)
    return [_make_fit(each, linear.name, output, bare.context, target) for each in states]


def list_process_fits(fit: CalibrationResult, target: Target) -> list[CalibrationResult]:
    """Return simple processes in series if a linear simulation of second order is none, not calibrated."""
    linear, context = get_linear(fit), fit.simulation.context
    if linear is None:
        return []
    values = fit.values[fit.simulation.simulator_slice][: len(linear.parameters)]
    known = list_states(linear, values, context.dt)
    try:
        single = estimate_linear(1, linear.delay, make_fitted_record(context, target))
    except RecordError:  # Its longest recording is too short for a linear model.
        return []
    cascade = approximate_cascade(linear, single, known, context.dt)
    return [] if cascade is None else [_make_fit(cascade, linear.name, fit.output, context, target)]


def get_linear(fit: CalibrationResult) -> LinearSimulator | None:
    """Return the linear model of a fit; None if it is another simulation."""
    equation = fit.simulation.simulator
    linear = equation.simulator if isinstance(equation, OutputEquation) else None
    return linear if isinstance(linear, LinearSimulator) else None


def make_fitted_record(context: SimulationContext, target: Target) -> Dataset:
    """Return the longest recording, as far as it is fitted."""
    first, last = max(context.bounds, key=lambda ends: min(ends[1], target.fitted) - ends[0])
    part = slice(first, min(last, target.fitted))
    return Dataset(context.u[part], fill_gaps(target.y)[part], context.dt, ("u",))


def transfer_linear_values(found: LinearSimulator, linear: LinearSimulator) -> Signal:
    """Return the values of a linear model for another one, which counts its input from another value."""
    values = np.array([each.nominal for each in found.parameters])
    numerator, denominator, level, _ = found.split_values(values)
    distance = found.reference_input - linear.reference_input
    gain = float(numerator.sum()) / (1.0 - float(denominator.sum()))
    state = distance * (found.state_at_rest - linear.state_at_rest)
    first = 0 if linear.has_direct_term else 1
    return np.concatenate([numerator[first:], denominator, [level - gain * distance], state])


def calibrate_states(fit: CalibrationResult, target: Target) -> CalibrationResult:
    """Calibrate equations with the step size and the intersample behaviour that suit them."""
    fit = calibrate(fit.simulation, target, fit.values)
    simulator = select_intersample(fit, target)
    if simulator is fit.simulation.simulator:
        return fit
    return calibrate(replace(fit.simulation, simulator=simulator), target, fit.values)


def _make_fit(
    equations: LinearStates, name: str, output: Signal, context: SimulationContext, target: Target
) -> CalibrationResult:
    """Return equations with the initial states of an output of the linear simulation."""
    states = [
        equations.find_states(context.u[first:last], output[first:last]) for first, last in context.bounds
    ]
    simulator = _make_simulator(equations, name, states[0], context)
    context = replace(context, force_coordinate=simulator.make_force_coordinate(context, output))
    steps = max(ceil(equations.fastest * equations.dt / _LONGEST_STEP), 1)
    simulation = ExtendedSimulator(ResampledSimulator(simulator, InterSample.ZOH, steps), (), context)
    start: Signal = simulation.nominal
    for place, parameter in enumerate(simulation.parameters):
        if parameter.initial:
            state = parameter.name.removeprefix("initial ").partition(" ")[0]
            start[place] = states[simulation.recordings[place]][state]
    return evaluate_fit(simulation, target, start)


def _make_simulator(
    equations: LinearStates, name: str, initial: dict[str, float], context: SimulationContext
) -> OdeSimulator:
    """Make the simulator of the equations, whose sizes are those of a simulation of each recording."""
    system = equations.make_system(name, context.input_unit, context.output_unit, context.output_peak)
    names = [*equations.states, *(f"d{each}/dt" for each in equations.states)]
    rough = OdeSimulator(system, initial, dict.fromkeys(names, 1.0), {})
    expressions = (*map(Symbol, equations.states), *(right for _, right in system.derivatives))
    parts = [rough.simulate_nominal(part, expressions) for part in context.split()]
    sizes = [peak_amplitude(signal) for signal in np.concatenate(parts, axis=1)]
    return replace(rough, sizes=dict(zip(names, sizes, strict=True)))
