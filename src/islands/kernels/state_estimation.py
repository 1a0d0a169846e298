"""Estimation of the states at the first row of a segment by the squared error of its free run."""

import math

import numpy as np

from islands.kernels.damped_step import factor, solve_factored
from islands.kernels.jit_cache import kernel
from islands.kernels.state_space import simulate_state_space, trace_states
from islands.kernels.state_space_products import accumulate_products

#: Steps of an estimation, the step that ends it, and the decrease of the error, relative to it.
_STEPS, _NEGLIGIBLE_STEP, _NEGLIGIBLE_DECREASE = 30, 1e-9, 1e-13


@kernel
def find_nearest(
    theta,
    codes,  # int64 [unit]
    u,  # float64 [row, input]
    y,  # float64 [row]: measured; NaN is left out
    lower,  # limits of the sensor: a measured limit is no error of a simulation beyond it
    upper,
    starts,  # float64 [start, state]
):
    """Return the place of the start whose free run has the least squared error; 0 if all diverge."""
    best, least, simulated, x = 0, np.inf, np.empty(y.size), np.empty(starts.shape[1])
    for place in range(len(starts)):
        x[:] = starts[place]
        if simulate_state_space(theta, codes, u, x, simulated) < y.size:
            continue
        total = 0.0
        for k in range(y.size):
            error = y[k] - simulated[k]
            beyond = (y[k] >= upper and error < 0.0) or (y[k] <= lower and error > 0.0)
            if not (math.isnan(error) or beyond):
                total += error * error
        if total < least:
            best, least = place, total
    return best


@kernel
def minimise_error(
    theta,
    codes,  # int64 [unit]
    u,  # float64 [row, input]
    y,  # float64 [row]: measured; NaN is left out
    lower,  # limits of the sensor
    upper,
    rest,  # float64 [state]: states at rest
    weight,  # of the squared distance from them
    best,  # float64 [state]: the start, replaced by the states of the least error
):
    """Take Gauss-Newton steps; return the least error, which is infinite if the model diverges at the start.

    A step that increases the error is halved.
    """
    n, units, least = rest.size, codes.size, np.inf
    places, traces = np.full(theta.size, -1), np.empty((y.size, n + 2 * units, 1))
    products, normal, states, step = np.empty((n + 1, n + 1)), np.empty((n, n)), best.copy(), np.zeros(n)
    no_derivatives = np.empty((0, 0))
    for _ in range(_STEPS):
        error, is_bounded = np.inf, trace_states(theta, codes, u, states, traces) == y.size
        if is_bounded:
            accumulate_products(
                theta, places, units, traces, 0, u, y, lower, upper, 0, products, no_derivatives
            )
            error = products[n, n]
            for i in range(n):
                error += weight * (states[i] - rest[i]) ** 2
        if error < least and np.isfinite(products).all():
            best[:], least, decrease = states, error, 0.0
            for i in range(n):
                normal[i] = products[i, :n]
                normal[i, i] += weight
                step[i] = products[i, n] - weight * (states[i] - rest[i])
            gradient = step.copy()
            if not factor(normal):
                break
            solve_factored(normal, step)
            for i in range(n):
                decrease += gradient[i] * step[i]
            if not decrease > _NEGLIGIBLE_DECREASE * least:
                break
        elif least == np.inf:
            break
        else:
            step *= 0.5
        if np.abs(step).max() < _NEGLIGIBLE_STEP:
            break
        states[:] = best + step
    return least
