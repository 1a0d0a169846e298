"""Kernels that simulate an FMU over a record: communication steps, or integration by RK4.

An FMU is initialised before they run. They return the number of computed samples and the status of the last
call; samples after a failure keep their values. Equations read what the FMU computes, and their results are
the derivatives and the outputs of the simulation.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.jit_cache import kernel
from islands.simulators.fmu.fmi_calls import (
    TERMINATED,
    WARNING,
    complete_step,
    do_step,
    enter,
    exchange_states,
    exchange_values,
    set_time,
    update_discrete_states,
)
from islands.simulators.ode.kernel import execute_code
from islands.simulators.ode.kernel_arguments import LANES, Instructions, LaneForces, LaneLimits


class FmuEquations(NamedTuple):
    """Equations around an FMU, in the first lane of the rows of an arena.

    Attributes
    ----------
    instructions : Instructions
    arena : ndarray, shape (rows*16,)
        Constants, parameters and initial states.
    signals : ndarray, shape (steps, 3, signals)
        Signals at the start, in the middle and at the end of each step.
    signal_rows : ndarray of int64, shape (signals,)
    laws : LaneForces
    limits : LaneLimits
    places : ndarray of int64, shape (states,)
        Index of each state of the equations among the states of the FMU, which further ones follow.
    derivative_places, derivative_rows : ndarray of int64, shape (derivatives,)
        States of the FMU whose derivatives are read, and their rows.
    value_references, value_rows : ndarray of uint32 and of int64, shape (values,)
        Variables of the FMU that the outputs read, and their rows.
    """

    instructions: Instructions
    arena: NDArray[np.float64]
    signals: NDArray[np.float64]
    signal_rows: NDArray[np.int64]
    laws: LaneForces
    limits: LaneLimits
    places: NDArray[np.int64]
    derivative_places: NDArray[np.int64]
    derivative_rows: NDArray[np.int64]
    value_references: NDArray[np.uint32]
    value_rows: NDArray[np.int64]


@kernel
def take_steps(fmu, equations, begin, dt, start, held, inputs, y):
    """Simulate by co-simulation with one communication step per sample.

    Parameters
    ----------
    fmu : FmiFunctions
    equations : FmuEquations
        Equations of outputs, without states.
    begin, dt : float
        Time of the first sample and communication step in seconds.
    start, held : ndarray, shape (samples, inputs)
        Inputs at the samples, at which the outputs are read, and inputs during the steps.
    inputs : ndarray of uint32
        Value references.
    y : ndarray, shape (samples, outputs)
        Receives the outputs.
    """
    flags, last, none = np.zeros(3, np.uint8), np.zeros(1), np.empty(0)
    values = np.empty(equations.value_rows.size)
    samples = y.shape[0]
    for k in range(samples):
        status = exchange_values(fmu.set_values, fmu, inputs, start[k])
        if status <= WARNING:
            status = _write_outputs(fmu, equations, k, none, none, values, y[k])
        if status > WARNING:
            return k, status
        if k + 1 == samples:
            break
        status = exchange_values(fmu.set_values, fmu, inputs, held[k])
        if status <= WARNING:
            status = do_step(fmu, begin + k * dt, dt, flags, last)
        if status > WARNING:
            return k + 1, status
    return samples, 0


@kernel
def integrate(fmu, equations, begin, dt, start, middle, end, inputs, states, indicators, completes, y):
    """Simulate by model exchange, with the Runge-Kutta method of fourth order and a fixed step.

    An event takes effect at the end of the step in which it occurs, so that the step size is the same in
    every simulation and the result is reproducible.

    Parameters
    ----------
    fmu : FmiFunctions
    equations : FmuEquations
    begin, dt : float
        Time of the first sample and step of the integrator in seconds.
    start, middle, end : ndarray, shape (steps, inputs)
        Inputs at the start, in the middle and at the end of each step.
    inputs : ndarray of uint32
        Value references.
    states, indicators : int
        Numbers of states and event indicators of the FMU.
    completes : bool
        Whether the FMU is notified of completed steps.
    y : ndarray, shape (steps, outputs)
        Receives the outputs at the start of each step.
    """
    flags, next_time = np.zeros(32, np.uint8), np.zeros(1)
    size = states
    for place in equations.places:
        size = max(size, place + 1)
    x, stage, slope, total = np.zeros(size), np.empty(size), np.empty(size), np.empty(size)
    # Those of the FMU.
    fmu_x, fmu_total = x[:states], total[:states]
    before, after = np.empty(indicators), np.empty(indicators)
    values = np.empty(equations.value_rows.size)
    samples = y.shape[0]
    status = _begin(fmu, equations, inputs, start[0], x, fmu_x, before, flags, next_time)
    if status > WARNING:
        return 0, status
    for k in range(samples):
        time, following = begin + k * dt, begin + (k + 1) * dt
        status = exchange_values(fmu.set_values, fmu, inputs, start[k])
        if status <= WARNING:
            status = exchange_states(fmu.get_derivatives, fmu, fmu_total)
        if status <= WARNING:
            status = _write_outputs(fmu, equations, k, x, total, values, y[k])
        if status > WARNING:
            return k, status
        if k + 1 == samples:
            break
        _read_slopes(equations, total)
        slope[:] = total
        status = _add_stages(
            fmu, equations, k, time, dt, inputs, middle[k], end[k], x, stage, slope, total, states
        )
        if status > WARNING:
            return k + 1, status
        x += dt / 6.0 * total
        _limit(equations, x)
        status = set_time(fmu, following)
        if status <= WARNING:
            status = exchange_values(fmu.set_values, fmu, inputs, end[k])
        if status <= WARNING:
            status = exchange_states(fmu.set_states, fmu, fmu_x)
        if status <= WARNING:
            status = _finish_step(fmu, following, completes, before, after, fmu_x, flags, next_time)
        if status > WARNING:
            return k + 1, status
        if not np.isfinite(x).all():
            return k + 1, TERMINATED
    return samples, 0


@kernel
def _begin(fmu, equations, inputs, start, x, fmu_x, before, flags, next_time):
    """Enter continuous time, and read the initial states and indicators; return the status."""
    status = _resolve_events(fmu, flags, next_time)
    if status <= WARNING:
        status = exchange_states(fmu.get_states, fmu, fmu_x)
    for i in range(equations.places.size):
        x[equations.places[i]] = equations.arena[LANES * (equations.instructions.states + i)]
    if status <= WARNING:
        status = exchange_states(fmu.set_states, fmu, fmu_x)
    if status <= WARNING:
        status = exchange_values(fmu.set_values, fmu, inputs, start)
    if status <= WARNING:
        status = exchange_states(fmu.get_indicators, fmu, before)
    return status


@kernel
def _add_stages(fmu, equations, k, time, dt, inputs, middle, end, x, stage, slope, total, states):
    """Add the derivatives at the last three stages of step ``k`` to ``total``; return the status.

    ``slope`` has the derivatives at the first stage, and ``stage`` receives the states of each stage.
    """
    fmu_stage, fmu_slope = stage[:states], slope[:states]
    for part in range(3):
        fraction = 1.0 if part == 2 else 0.5
        stage[:] = x + fraction * dt * slope
        status = set_time(fmu, time + fraction * dt)
        if status <= WARNING:
            status = exchange_values(fmu.set_values, fmu, inputs, end if part == 2 else middle)
        if status <= WARNING:
            status = exchange_states(fmu.set_states, fmu, fmu_stage)
        if status <= WARNING:
            status = exchange_states(fmu.get_derivatives, fmu, fmu_slope)
        if status > WARNING:
            return status
        _execute(equations, k, 2 if part == 2 else 1, stage, slope, 2)
        _read_slopes(equations, slope)
        total += slope if part == 2 else 2.0 * slope
    return 0


@kernel(forceinline=True)
def _write_outputs(fmu, equations, k, x, slope, values, y):
    """Evaluate the equations at the start of a step, and write the outputs; return the status."""
    status = exchange_values(fmu.get_values, fmu, equations.value_references, values)
    if status > WARNING:
        return status
    for i in range(values.size):
        equations.arena[LANES * equations.value_rows[i]] = values[i]
    _execute(equations, k, 0, x, slope, 3)
    for output in range(y.size):
        y[output] = equations.arena[LANES * equations.instructions.outputs[output]]
    return status


@kernel(forceinline=True)
def _execute(equations, k, moment, x, slope, last):
    """Execute the equations up to a section, for states and derivatives by the FMU at a moment of a step."""
    instructions, arena = equations.instructions, equations.arena
    for s in range(equations.signal_rows.size):
        arena[LANES * equations.signal_rows[s]] = equations.signals[k, moment, s]
    for i in range(equations.places.size):
        arena[LANES * (instructions.states + i)] = x[equations.places[i]]
    for i in range(equations.derivative_rows.size):
        arena[LANES * equations.derivative_rows[i]] = slope[equations.derivative_places[i]]
    first = 0 if k == 0 and moment == 0 else instructions.ends[0]
    execute_code(instructions, first, instructions.ends[last], arena.ctypes.data, arena, equations.laws, 1)


@kernel(forceinline=True)
def _read_slopes(equations, slope):
    """Replace the derivatives of the states that have equations."""
    for i in range(equations.places.size):
        row = equations.instructions.slopes[i]
        slope[equations.places[i]] = equations.arena[LANES * row]


@kernel(forceinline=True)
def _limit(equations, x):
    """Limit the states at a sample; a NaN remains."""
    limits, states = equations.limits, equations.limits.lower.size // LANES
    for i in range(states):
        place = equations.places[i]
        if x[place] < limits.lower[LANES * i]:
            x[place] = limits.lower[LANES * i]
        elif x[place] > limits.upper[LANES * i]:
            x[place] = limits.upper[LANES * i]


@kernel
def _finish_step(fmu, time, completes, before, indicators, x, flags, next_time):
    """Complete a step, and handle the events in it; an event may change the states. Return the status."""
    status, is_event = 0, time >= next_time[0] - 1e-12 * abs(time)
    if completes:
        status, is_asked = complete_step(fmu, flags)
        is_event = is_event or is_asked
    if status <= WARNING and indicators.size > 0:
        status = exchange_states(fmu.get_indicators, fmu, indicators)
        for place in range(indicators.size):
            is_event = is_event or (indicators[place] > 0.0) != (before[place] > 0.0)
        before[:] = indicators
    if status > WARNING or not is_event:
        return status
    status = enter(fmu.enter_events, fmu)
    if status <= WARNING:
        status = _resolve_events(fmu, flags, next_time)
    if status <= WARNING:
        status = exchange_states(fmu.get_states, fmu, x)
    if status <= WARNING:
        status = exchange_states(fmu.get_indicators, fmu, before)
    return status


@kernel
def _resolve_events(fmu, flags, next_time):
    """Iterate the event equations and enter continuous time; return the status."""
    status = update_discrete_states(fmu, flags, next_time)
    if status <= WARNING:
        status = enter(fmu.enter_continuous_time, fmu)
    return status
