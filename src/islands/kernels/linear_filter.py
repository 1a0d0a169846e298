"""Linear filter, with the bits of `scipy.signal.lfilter`, whose import takes half a second."""

import numpy as np

from islands.kernels.jit_cache import kernel


@kernel
def _filter(b, a, x, state, y):
    """Filter ``x`` by the transposed direct form II; write ``y``, and the last state into ``state``."""
    last = state.size - 1
    if last == 0:  # in registers
        at = state[0]
        for k in range(x.size):
            y[k] = at + b[0] * x[k]
            at = b[1] * x[k] - a[1] * y[k]
        state[0] = at
        return
    for k in range(x.size):
        now, out = x[k], state[0] + b[0] * x[k]
        for n in range(last):
            state[n] = state[n + 1] + now * b[n + 1] - out * a[n + 1]
        state[last] = now * b[last + 1] - out * a[last + 1]
        y[k] = out


@kernel
def _low_pass(x, weights, decay, y):
    """Filter ``x`` by a first-order low-pass whose input is weighted over four neighbours; write ``y``."""
    last, start = x.size - 1, x[0]
    y[0] = start
    before, here, after = 0.0, 0.0, x[min(1, last)] - start
    state = 0.0
    for k in range(last):
        later = x[min(k + 2, last)] - start
        moved = before * weights[0] + here * weights[1] + after * weights[2] + later * weights[3]
        followed = state + moved
        state = 0.0 * moved + decay * followed
        y[k + 1] = followed + start
        before, here, after = here, after, later


@kernel
def _divide_rows(a, x, ends, y):
    """Divide every row of ``x`` by ``1 + a1 q^-1 + ...``, from rest at the start of every segment."""
    # A recursion waits for its last value. Four rows at a time take a third of the time of one after another.
    last = x.shape[0] - 1
    for r0 in range(0, last + 1, 4):
        r1, r2, r3 = min(r0 + 1, last), min(r0 + 2, last), min(r0 + 3, last)
        begin = 0
        for segment in range(ends.size):
            for k in range(begin, ends[segment]):
                y0, y1, y2, y3 = x[r0, k], x[r1, k], x[r2, k], x[r3, k]
                for n in range(min(a.size, k - begin)):
                    before = k - 1 - n
                    y0 -= a[n] * y[r0, before]
                    y1 -= a[n] * y[r1, before]
                    y2 -= a[n] * y[r2, before]
                    y3 -= a[n] * y[r3, before]
                y[r0, k], y[r1, k], y[r2, k], y[r3, k] = y0, y1, y2, y3
            begin = ends[segment]


def divide_rows(a, x, ends):
    """Divide series by ``1 + a1 q^-1 + a2 q^-2 + ...``, from rest at the start of every segment.

    Parameters
    ----------
    a : ndarray, shape (order,)
    x : ndarray, shape (series, samples)
    ends : ndarray of int64, shape (segments,)
        Sample after the last one of every segment.

    Returns
    -------
    ndarray, shape (series, samples)
    """
    y = np.empty(x.shape)
    _divide_rows(np.ascontiguousarray(a), np.ascontiguousarray(x), ends, y)
    return y


def filter_linearly(b, a, x, state=None):
    """Filter a signal by ``(b0 + b1 q^-1 + ...) / (1 + a1 q^-1 + ...)``.

    Parameters
    ----------
    b, a : sequence of float
        Coefficients; the first one of ``a`` is 1.
    x : ndarray, shape (samples,)
    state : ndarray, shape (order,), optional
        State of the transposed direct form II at the first sample; by default zero.

    Returns
    -------
    ndarray, shape (samples,)
    """
    order = max(len(b), len(a)) - 1
    y = np.empty(x.size)
    if order == 0:
        return b[0] * x
    numerator, denominator = np.zeros(order + 1), np.zeros(order + 1)
    numerator[: len(b)], denominator[: len(a)] = b, a
    began = np.zeros(order) if state is None else np.array(state, dtype=np.float64)
    _filter(numerator, denominator, np.ascontiguousarray(x), began, y)
    return y


def low_pass_cubic(x, weights, decay):
    """Filter a signal by a first-order low-pass that is exact for cubics through four neighbours.

    Parameters
    ----------
    x : ndarray, shape (samples,)
    weights : ndarray, shape (4,)
        Weights of the samples from the one before to the second one after an interval, as deviations from the
        first sample, which precedes the record.
    decay : float
        Factor of the output in an interval.
    """
    y = np.empty(x.size)
    _low_pass(np.ascontiguousarray(x), weights, decay, y)
    return y
