"""Kernel for two cascaded tanks."""

import numpy as np

from islands.kernels.jit_cache import kernel


@kernel
def cascade(
    u,  # total inflow of the upper tank, (samples,)
    intersample,  # inflow half a step and one step after each sample, (2, samples)
    dt,
    upper,  # k and l of the outflow, overflow level, fraction of the overflow that enters the lower tank
    lower,  # k and l of the outflow, overflow level, direct inflow of the lower tank
    x1,  # initial levels
    x2,
    y,  # level of the lower tank, (samples,), written
):
    """Integrate ``x1' = u - q1``, ``x2' = q1 + caught + inflow - q2`` by the midpoint rule.

    The outflows are ``q = k sqrt(x) + l x``. Each tank overflows at its overflow level. A fraction of the
    overflow of the upper tank enters the lower tank.
    """
    root1, linear1, rim1, caught = upper
    root2, linear2, rim2, inflow = lower
    for k in range(u.size):
        y[k] = x2
        out1 = root1 * np.sqrt(x1) + linear1 * x1
        out2 = root2 * np.sqrt(x2) + linear2 * x2
        half1 = max(x1 + 0.5 * dt * (u[k] - out1), 0.0)
        half2 = max(x2 + 0.5 * dt * (out1 + inflow - out2), 0.0)
        out1 = root1 * np.sqrt(half1) + linear1 * half1
        out2 = root2 * np.sqrt(half2) + linear2 * half2
        x1 += dt * (intersample[0, k] - out1)
        overflow = max(x1 - rim1, 0.0)
        x1 = max(x1 - overflow, 0.0)
        x2 = min(max(x2 + dt * (out1 + inflow - out2) + caught * overflow, 0.0), rim2)
