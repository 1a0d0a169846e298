"""Operators with memory: play, stick-slip slider, rate limiter, uneven and growing lag."""

import math

import numpy as np

from islands.kernels.jit_cache import kernel


@kernel
def play(u, width, x):
    """Apply a play operator of half width ``width`` to ``u`` (samples,), starting at ``u[0]``.

    Write the output to ``x``.
    """
    at = u[0]
    for k in range(u.size):
        if u[k] - width > at:
            at = u[k] - width
        elif u[k] + width < at:
            at = u[k] + width
        x[k] = at


@kernel
def slider(u, breakaway, x):
    """Apply a stick-slip slider to ``u``; write ``x``.

    ``x`` is constant until ``u`` differs from it by ``breakaway``, and then jumps to ``u``. Between two
    samples ``u`` is continuous, so ``x`` can slip several times within a step.
    """
    at = u[0]
    for k in range(u.size):
        at += breakaway * np.trunc((u[k] - at) / breakaway)
        x[k] = at


@kernel
def jumper(u, breakaway, x):
    """Apply a stick-slip slider to an input ``u`` that is held between samples; write ``x``.

    ``x`` is constant until ``u`` differs from it by more than ``breakaway``, and then jumps to ``u``.
    """
    at = u[0]
    for k in range(u.size):
        if abs(u[k] - at) > breakaway:
            at = u[k]
        x[k] = at


@kernel
def _limit_steps(u, steps, x):
    at = u[0]
    x[0] = at
    for k in range(1, u.size):
        change, gap, step = u[k] - u[k - 1], u[k - 1] - at, steps[k]
        # The fraction of the interval after which the output meets the input, which is linear in it.
        closing = np.copysign(step, gap) - change
        met = 0.0 if gap == 0.0 else 1.0
        if gap * closing > 0.0:
            met = gap / closing
        if met >= 1.0:
            at += np.copysign(step, gap)
        elif abs(change) <= step:
            at = u[k]
        else:
            at = u[k - 1] + change * met + np.copysign(step, change) * (1.0 - met)
        x[k] = at


#: Least time constant of a lag, relative to the sampling time. It has no visible effect.
LEAST_LAG = 1e-9


@kernel
def _close_gap(gap, slope, time, slow, times):
    """Return the gap between input and output after a time in which the input has a constant slope.

    The gap is a curve over the rate of the output: two straight lines on each side of zero.
    """
    while True:
        side = np.copysign(1.0, gap if gap != 0.0 else slope)
        distance, rise = side * gap, side * slope
        near, tau = (times[2], times[3]) if side > 0.0 else (times[1], times[0])
        edge = slow * near
        lower, rate = edge, slow
        if distance < edge or (distance == edge and rise <= slow):
            lower, rate, tau = 0.0, 0.0, near
        # The gap at which the output is as fast as the input, and the gap at which the time constant changes.
        end = lower + tau * (rise - rate)
        change = -1.0
        if end < lower:
            change = lower
        elif lower == 0.0 and end > edge:
            change = edge
        passed = tau * math.log((distance - end) / (change - end)) if change >= 0.0 else time
        if not passed < time:  # also for an input that is not finite
            return side * (end + (distance - end) * math.exp(-time / tau))
        gap, time = side * change, time - passed


@kernel
def _follow(u, dt, slow, times, x):
    gap = 0.0
    x[0] = u[0]
    for k in range(1, u.size):
        slope = (u[k] - u[k - 1]) / dt
        if gap != 0.0 or slope != 0.0:
            gap = _close_gap(gap, slope, dt, slow, times)
        x[k] = u[k] - gap


#: Steps of a lag that grows with its error in a sampling interval.
GROWING_LAG_STEPS = 8

#: Weights of the four samples around a sampling interval in the changes of their cubic in each of its steps.
_CUBIC_CHANGES = np.diff(
    [
        [
            -s * (s - 1) * (s - 2) / 6,
            (s * s - 1) * (s - 2) / 2,
            -s * (s + 1) * (s - 2) / 2,
            s * (s * s - 1) / 6,
        ]
        for s in np.arange(GROWING_LAG_STEPS + 1) / GROWING_LAG_STEPS
    ],
    axis=0,
)


@kernel
def _follow_by_gap(u, weights, step, tau, inverse_rate, x):
    ratio = step / tau
    # The part of a step at which the slope is taken: exact for a constant lag, and stable for a short one.
    part = -1.0 / math.expm1(-ratio) - 1.0 / ratio
    gap, last = 0.0, u.size - 1
    x[0] = u[0]
    for k in range(1, u.size):
        before, here, after, later = u[max(k - 2, 0)], u[k - 1], u[k], u[min(k + 1, last)]
        for row in weights:
            change = row[0] * before + row[1] * here + row[2] * after + row[3] * later
            ahead = gap + part * change
            # The gap at that part solves gap + part step gap/(tau + inverse_rate |gap|) = ahead.
            size = abs(ahead)
            half = 0.5 * (tau + part * step - inverse_rate * size)
            root = math.sqrt(half * half + inverse_rate * size * tau)
            middle = size * tau / (half + root) if half > 0.0 else (root - half) / inverse_rate
            gap += (math.copysign(middle, ahead) - gap) / part
        x[k] = u[k] - gap


def play_from(u, width):
    """Return the output of a play operator of half width ``width`` with input ``u``."""
    x = np.empty_like(u)
    play(np.ascontiguousarray(u), width, x)
    return x


def limit_rate(u, step):
    """Return ``u`` (samples,) with a limited rate of change.

    The output starts at ``u[0]`` and follows the input, which is linear between samples.

    Parameters
    ----------
    step : float or ndarray, shape (samples,)
        Largest change of the output in each sampling interval, or in the interval before each sample.
    """
    x = np.empty_like(u)
    _limit_steps(np.ascontiguousarray(u), np.full(u.shape, step), x)
    return x


def lag_unevenly(u, dt, slow, times):
    """Return ``u`` (samples,) with a first-order lag whose time constant depends on the rate of the output.

    The output starts at ``u[0]``. It is exact for an input that is linear between samples.

    Parameters
    ----------
    dt : float
        Sampling time in seconds.
    slow : float
        Rate of the output per second at which the time constant changes. The distance to ``u`` is continuous.
    times : ndarray, shape (4,)
        Time constants in seconds: falling fast, falling slowly, rising slowly, and rising fast.
    """
    x = np.array(u)
    if np.max(times) > 0.0:
        _follow(np.ascontiguousarray(u), dt, slow, np.maximum(times, LEAST_LAG * dt), x)
    return x


def lag_by_gap(u, dt, tau, inverse_rate):
    """Return ``u`` (samples,) with a lag that grows with its error: ``x' = e/(tau + inverse_rate |e|)``.

    The error ``e`` is ``u - x``, and the rate of the output is below ``1/inverse_rate``. The output starts at
    ``u[0]``, and the input is a cubic through four neighbouring samples.

    Parameters
    ----------
    dt : float
        Sampling time in seconds.
    tau : float
        Time constant of a small error, in seconds.
    inverse_rate : float
        Seconds for a unit of the input.
    """
    x = np.array(u)
    if tau > 0.0:
        step = dt / GROWING_LAG_STEPS
        least = max(tau, LEAST_LAG * dt)
        _follow_by_gap(np.ascontiguousarray(u), _CUBIC_CHANGES, step, least, inverse_rate, x)
    return x
