"""First-order low-pass filters that begin at rest with their signal."""

import numpy as np
import scipy

from islands.discrepancy.effect import Signal


def low_pass(signal: Signal, tau: float, dt: float) -> Signal:
    """Return what follows a signal with a time constant, the signal running straight between samples."""
    a = np.exp(-dt / tau)
    b1 = 1.0 - tau / dt * (1.0 - a)
    b0 = tau / dt * (1.0 - a) - a
    start = signal[0]
    followed, _ = scipy.signal.lfilter([b1, b0], [1.0, -a], signal - start, zi=[0.0])
    out: Signal = followed + start
    return out
