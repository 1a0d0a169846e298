"""Modal form of a linear system: one state for each real pole, two for each complex pair.

A pair ``p = r exp(+-i w)`` has the block ``[[r cos w, r sin w], [-r sin w, r cos w]]``, so that each block of
states is one mode with a time constant or a resonance.
"""

import numpy as np
from numpy.typing import NDArray

#: Largest condition number of the transformation: poles that are almost equal have almost equal modes.
_LARGEST_CONDITION = 1e6


def find_modal_form(
    a: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return the block-diagonal form of a matrix, slowest mode first, and the transformation ``x = T z``.

    Parameters
    ----------
    a : ndarray, shape (states, states)

    Returns
    -------
    tuple of ndarray, shapes (states, states) and (states, states), or None
        None if the modes depend on each other almost.
    """
    poles, vectors = np.linalg.eig(a)
    order = sorted(range(len(poles)), key=lambda at: (-abs(poles[at]), poles[at].real, poles[at].imag))
    blocks = np.zeros_like(a)
    columns: list[NDArray[np.float64]] = []
    for at in order:
        pole, place = poles[at], len(columns)
        if pole.imag == 0.0:
            blocks[place, place] = pole.real
            columns.append(vectors[:, at].real)
        elif pole.imag > 0.0:
            blocks[place : place + 2, place : place + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
            columns += [vectors[:, at].real, vectors[:, at].imag]
    forward = np.column_stack(columns)
    return (blocks, forward) if np.linalg.cond(forward) <= _LARGEST_CONDITION else None
