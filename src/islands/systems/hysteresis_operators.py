"""Hysteresis operators: play, stick-slip slider and Bouc-Wen element, each a single pass over the samples."""

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
def bouc_wen(u, dt, A, beta, gamma, leak, rate, asymmetry, h0, h):
    """Integrate ``h' = A u' - b |u'| h - g u' |h| - leak h - asymmetry |u'| |h|`` with RK4; write ``h``.

    The input is interpolated linearly. ``b`` and ``g`` are ``beta`` and ``gamma`` times
    ``max(0.05, 1 + rate |u'|)``.
    """
    at = h0
    h[0] = at
    for k in range(u.size - 1):
        du = u[k + 1] - u[k]
        move = abs(du)
        faster = max(0.05, 1.0 + rate * move / dt)
        b = beta * faster * move
        g = gamma * faster * du
        a = asymmetry * move
        lost = leak * dt
        first = A * du - b * at - g * abs(at) - lost * at - a * abs(at)
        now = at + 0.5 * first
        second = A * du - b * now - g * abs(now) - lost * now - a * abs(now)
        now = at + 0.5 * second
        third = A * du - b * now - g * abs(now) - lost * now - a * abs(now)
        now = at + third
        fourth = A * du - b * now - g * abs(now) - lost * now - a * abs(now)
        at += (first + 2.0 * second + 2.0 * third + fourth) / 6.0
        h[k + 1] = at


def play_from(u, width):
    """Return the output of a play operator of half width ``width`` with input ``u``."""
    x = np.empty_like(u)
    play(np.ascontiguousarray(u), width, x)
    return x
