"""Kernels that simulate an FMU over a record: communication steps, or integration by RK4.

An FMU is initialised before they run. They return the number of computed samples and the status of the last
call; samples after a failure keep their values.
"""

import numpy as np

from islands.kernels.jit_cache import kernel
from islands.systems.fmu.fmi_calls import (
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


@kernel
def take_steps(fmu, begin, dt, start, held, inputs, outputs, y):
    """Simulate by co-simulation with one communication step per sample.

    Parameters
    ----------
    fmu : FmiFunctions
    begin, dt : float
        Time of the first sample and communication step in seconds.
    start, held : ndarray, shape (samples, inputs)
        Inputs at the samples, at which the outputs are read, and inputs during the steps.
    inputs, outputs : ndarray of uint32
        Value references.
    y : ndarray, shape (samples, outputs)
        Receives the outputs.
    """
    flags, last = np.zeros(3, np.uint8), np.zeros(1)
    samples = y.shape[0]
    for k in range(samples):
        status = exchange_values(fmu.set_values, fmu, inputs, start[k])
        if status <= WARNING:
            status = exchange_values(fmu.get_values, fmu, outputs, y[k])
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
def integrate(
    fmu, begin, dt, start, middle, end, inputs, outputs, places, initial, x, indicators, completes, every, y
):
    """Simulate by model exchange, with the Runge-Kutta method of fourth order and a fixed step.

    An event takes effect at the end of the step in which it occurs, so that the step size is the same in
    every simulation and the result is reproducible.

    Parameters
    ----------
    fmu : FmiFunctions
    begin, dt : float
        Time of the first sample and step of the integrator in seconds.
    start, middle, end : ndarray, shape (steps, inputs)
        Inputs at the start, in the middle and at the end of each step.
    inputs, outputs : ndarray of uint32
        Value references.
    places : ndarray of int64
        Indices of the states that get the values ``initial`` at the first sample.
    initial : ndarray, shape (places,)
    x, indicators : ndarray, shape (states,) and (event indicators,)
        Memory, whose sizes are the numbers of states and event indicators.
    completes : bool
        Whether the FMU is notified of completed steps.
    every : int
        Steps per sample.
    y : ndarray, shape (samples, outputs)
        Receives the outputs.
    """
    flags, next_time = np.zeros(32, np.uint8), np.zeros(1)
    stage, slope, total = np.empty_like(x), np.empty_like(x), np.empty_like(x)
    before = np.empty(indicators.size)
    samples = y.shape[0]
    status = _resolve_events(fmu, flags, next_time)
    if status <= WARNING:
        status = exchange_states(fmu.get_states, fmu, x)
    for place in range(places.size):
        x[places[place]] = initial[place]
    if status <= WARNING:
        status = exchange_states(fmu.set_states, fmu, x)
    if status <= WARNING:
        status = exchange_values(fmu.set_values, fmu, inputs, start[0])
    if status <= WARNING:
        status = exchange_states(fmu.get_indicators, fmu, before)
    if status > WARNING:
        return 0, status
    for k in range((samples - 1) * every + 1):
        time, following = begin + k * dt, begin + (k + 1) * dt
        status = exchange_values(fmu.set_values, fmu, inputs, start[k])
        if k % every == 0:
            sample = k // every
            if status <= WARNING:
                status = exchange_values(fmu.get_values, fmu, outputs, y[sample])
            if status > WARNING:
                return sample, status
            if sample + 1 == samples:
                break
        if status <= WARNING:
            status = exchange_states(fmu.get_derivatives, fmu, total)
        for part in range(3):
            if status > WARNING:
                break
            fraction = 1.0 if part == 2 else 0.5
            stage[:] = x + fraction * dt * (total if part == 0 else slope)
            at_end = time + fraction * dt
            status = _evaluate(fmu, at_end, end[k] if part == 2 else middle[k], inputs, stage, slope)
            total += slope if part == 2 else 2.0 * slope
        if status <= WARNING:
            x += dt / 6.0 * total
            status = set_time(fmu, following)
        if status <= WARNING:
            status = exchange_values(fmu.set_values, fmu, inputs, end[k])
        if status <= WARNING:
            status = exchange_states(fmu.set_states, fmu, x)
        if status <= WARNING:
            status = _finish_step(fmu, following, completes, before, indicators, x, flags, next_time)
        if status > WARNING:
            return k // every + 1, status
        if not np.isfinite(x).all():
            return k // every + 1, TERMINATED
    return samples, 0


@kernel
def _evaluate(fmu, time, values, inputs, x, slope):
    """Evaluate the derivatives; return the status."""
    status = set_time(fmu, time)
    if status <= WARNING:
        status = exchange_values(fmu.set_values, fmu, inputs, values)
    if status <= WARNING:
        status = exchange_states(fmu.set_states, fmu, x)
    if status <= WARNING:
        status = exchange_states(fmu.get_derivatives, fmu, slope)
    return status


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
