"""Rate limiter: a single pass over the samples."""

import numpy as np

from islands.kernels.jit_cache import kernel


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


def limit_rate(u, step):
    """Return ``u`` (samples,) with a limited rate of change.

    The output starts at ``u[0]`` and follows the input, which is linear between samples, by at most ``step``
    in each sampling interval.
    """
    x = np.empty_like(u)
    _limit_steps(np.ascontiguousarray(u), step, x)
    return x
