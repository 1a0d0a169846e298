"""Two tanks, one above the other."""

import numpy as np

from islands.kernels.jit_cache import kernel


@kernel
def cascade(
    u,  # inflow of the upper tank, (samples,): the pump, with what flows in beside it
    midway,  # (2, samples): half a step and a whole one behind each sample
    dt,
    upper,  # outflow of the upper tank: of its root, linear, level at which it overflows, part that is caught
    lower,  # outflow of the lower tank: of its root, linear, level at which it overflows, its own inflow
    x1,
    x2,
    y,  # level of the lower tank, (samples,), written
):
    """Integrate ``x1' = u - q1``, ``x2' = q1 + caught + own - q2`` by the midpoint rule.

    The outflows are ``q = k sqrt(x) + l x``.

    What would rise above a tank's rim flows over; of the upper tank's a part is caught by the lower one.
    """
    root1, linear1, rim1, caught = upper
    root2, linear2, rim2, own = lower
    for k in range(u.size):
        y[k] = x2
        out1 = root1 * np.sqrt(x1) + linear1 * x1
        out2 = root2 * np.sqrt(x2) + linear2 * x2
        half1 = max(x1 + 0.5 * dt * (u[k] - out1), 0.0)
        half2 = max(x2 + 0.5 * dt * (out1 + own - out2), 0.0)
        out1 = root1 * np.sqrt(half1) + linear1 * half1
        out2 = root2 * np.sqrt(half2) + linear2 * half2
        x1 += dt * (midway[0, k] - out1)
        over = max(x1 - rim1, 0.0)
        x1 = max(x1 - over, 0.0)
        x2 = min(max(x2 + dt * (out1 + own - out2) + caught * over, 0.0), rim2)
