"""Elements that remember: play, a slider that sticks, the Bouc-Wen element; one pass over the samples."""

import numpy as np

from islands.kernels.jit_cache import kernel


@kernel
def play(u, width, x):
    """Follow ``u`` (samples,) with a play of half width ``width``, from ``u[0]`` on; write ``x``."""
    at = u[0]
    for k in range(u.size):
        if u[k] - width > at:
            at = u[k] - width
        elif u[k] + width < at:
            at = u[k] + width
        x[k] = at


@kernel
def slider(u, breakaway, x):
    """Follow ``u`` in slips: ``x`` rests until ``u`` is ``breakaway`` away, and then joins it.

    Between two samples ``u`` passes through every value: ``x`` slips as often as it is that far away.
    """
    at = u[0]
    for k in range(u.size):
        at += breakaway * np.trunc((u[k] - at) / breakaway)
        x[k] = at


@kernel
def bouc_wen(u, dt, A, beta, gamma, leak, rate, asymmetry, h0, h):
    """Integrate ``h' = A u' - b |u'| h - g u' |h| - leak h - asymmetry |u'| |h|`` with RK4; write ``h``.

    The input runs straight from sample to sample; ``b`` and ``g`` are ``beta`` and ``gamma`` times
    ``1 + rate |u'|``, where that is positive.
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
    """Return ``u`` behind a play of half width ``width``."""
    x = np.empty_like(u)
    play(np.ascontiguousarray(u), width, x)
    return x
