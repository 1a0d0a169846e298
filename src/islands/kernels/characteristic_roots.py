"""Roots of the linear output terms of a model with a continuum of equilibria (the paper, Property 1).

At constant input and with phi functions at zero, a model is ``y(k) = theta_1 y(k-1) + ... + theta_n y(k-n)``
with parameters that sum to 1. It converges to an equilibrium if 1 is a simple root of its characteristic
polynomial and all other roots lie inside the unit circle. ``y(k) = y(k-15)`` has 15 roots on the circle: at
constant input it repeats its last 15 values for ever.
"""

import numpy as np

from islands.kernels.jit_cache import kernel

#: Smallest distance from the unit circle of a root other than 1.
MARGIN = 1e-6

#: Rounding of the sum of the parameters.
_ROUNDING = 1e-9


@kernel
def converges(
    theta,  # float64 [n]: parameters of y(k-1) ... y(k-n)
):
    """Return whether all roots other than a single 1 have a modulus below ``1 - MARGIN``.

    True as well if the parameters do not sum to 1: other terms are then part of the feedback at rest.
    The polynomial is divided by ``z - 1``; its quotient is tested by the recursion of Schur and Cohn, with
    ``z`` scaled so that the margin lies on the unit circle.
    """
    if abs(theta.sum() - 1.0) > _ROUNDING:
        return True
    degree = theta.size - 1
    quotient = np.empty(degree + 1)
    value, scale = 1.0, 1.0
    quotient[0] = 1.0
    for power in range(1, degree + 1):
        value -= theta[power - 1]
        scale /= 1.0 - MARGIN
        quotient[power] = value * scale
    swapped = np.empty(degree + 1)
    for order in range(degree, 0, -1):
        reflection = quotient[order] / quotient[0]
        if not abs(reflection) < 1.0:
            return False
        for power in range(order):
            swapped[power] = quotient[power] - reflection * quotient[order - power]
        for power in range(order):
            quotient[power] = swapped[power]
    return True
