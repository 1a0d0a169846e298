"""Resolution of a record: the change of its output below which nothing is claimed.

Rounding errors are no noise of the measurement: neighbouring ones are alike, so that effects and terms
explain them with any certainty (Widrow and Kollar, Quantization Noise, section 1).
"""

import numpy as np

from islands.effects.interface.context import Signal

#: Resolution of an output without a coarser lattice, relative to its range. Simulations differ by as much
#: through their integration.
RELATIVE_RESOLUTION = 1e-6

#: RMS value that is not resolved, in resolutions: between that of rounded values (0.29) and of truncated ones
#: (0.58).
UNRESOLVED_RMS = 0.5

#: RMS residual in resolutions from which noise of half a step makes means finer than the step.
DITHERED_RMS = (1.0 / 12.0 + 0.25) ** 0.5

#: Least number of levels of a lattice: of fewer, such as on and off, a simulation may be wrong between them.
MIN_LEVELS = 8

#: Largest distance of a value from a lattice, in steps.
_MAX_DISTANCE = 1e-3


def measure_resolution(y: Signal) -> float:
    """Return the resolution of an output: the step of its lattice, or a millionth of its range.

    Parameters
    ----------
    y : ndarray, shape (samples,)
        Missing samples are NaN.
    """
    levels = np.unique(y[~np.isnan(y)])
    if not levels.size:
        return 0.0
    rounding = float(np.finfo(float).eps * np.abs(levels[[0, -1]]).max())
    finest = max(RELATIVE_RESOLUTION * float(levels[-1] - levels[0]), 2.0 * rounding)
    step = float(np.diff(levels).min(initial=np.inf))
    if levels.size < MIN_LEVELS or step <= finest:
        return finest
    multiples = (levels - levels[0]) / step
    is_lattice = float(np.abs(multiples - np.round(multiples)).max()) < _MAX_DISTANCE
    return step if is_lattice else finest


def is_unresolved(change: Signal, resolution: float) -> bool:
    """Return whether a signal, such as a residual, is below the resolution; missing samples do not count."""
    known = change[~np.isnan(change)]
    return known.size > 0 and float(np.sqrt(np.mean(known**2))) <= UNRESOLVED_RMS * resolution
