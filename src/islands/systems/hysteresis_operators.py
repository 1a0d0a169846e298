"""Hysteresis operators: play and stick-slip slider, each a single pass over the samples."""

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


def play_from(u, width):
    """Return the output of a play operator of half width ``width`` with input ``u``."""
    x = np.empty_like(u)
    play(np.ascontiguousarray(u), width, x)
    return x
