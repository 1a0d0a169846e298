"""Operators with memory: play, stick-slip slider and rate limiter, each a single pass over the samples."""

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
def _limit_steps(u, step, x):
    at = u[0]
    x[0] = at
    for k in range(1, u.size):
        change, gap = u[k] - u[k - 1], u[k - 1] - at
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


def play_from(u, width):
    """Return the output of a play operator of half width ``width`` with input ``u``."""
    x = np.empty_like(u)
    play(np.ascontiguousarray(u), width, x)
    return x


def limit_rate(u, step):
    """Return ``u`` (samples,) with a limited rate of change.

    The output starts at ``u[0]`` and follows the input, which is linear between samples, by at most ``step``
    in each sampling interval.
    """
    x = np.empty_like(u)
    _limit_steps(np.ascontiguousarray(u), step, x)
    return x
