"""Reference implementations for tests of kernels: instructions and the order of rows."""

import numpy as np

from islands.kernels.interpreter import ADD, MULTIPLY, SIGN, SIGN_OF_DIFFERENCE, SIGN_OF_PRODUCT, SUBTRACT


def sign(a):
    return float((a > 0.0) - (a < 0.0))


#: Scalar operation of every instruction except calls; the sign has one argument.
NUMBERS = {
    MULTIPLY: lambda a, b: a * b,
    ADD: lambda a, b: a + b,
    SUBTRACT: lambda a, b: a - b,
    SIGN: sign,
    SIGN_OF_DIFFERENCE: lambda a, b: sign(a - b),
    SIGN_OF_PRODUCT: lambda a, b: sign(a * b),
}


def side_by_side(columns, rows):
    """Arrange 32 parts of every segment in parallel, padded with zeros, and return them row by row."""
    segments = []
    for part in np.split(columns, np.cumsum(rows)[:-1], axis=1):
        length = -(-part.shape[1] // 32)
        stretches = np.pad(part, ((0, 0), (0, 32 * length - part.shape[1]))).reshape(-1, 32, length)
        segments.append(np.pad(stretches, ((0, 0), (0, 0), (0, -length % 8))).swapaxes(1, 2))
    return np.hstack([part.reshape(len(columns), -1) for part in segments])
