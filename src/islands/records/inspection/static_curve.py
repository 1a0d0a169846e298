"""Points of a curve without a time: whether the order of the rows says more than the values of the input."""

import numpy as np
from numpy.typing import NDArray

from islands.errors import join_text, name_option

#: Distance of a point from the line through its neighbours on the curve, relative to the same distance from
#: its neighbours in the file, and to the standard deviation of the output, at most.
_BETTER, _NEAR = 0.5, 0.1

#: Points, at least.
_LEAST_POINTS = 8


def is_static_curve(u: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
    """Return whether the output is a curve over the input, in which the order of the rows has no part.

    If every row has a greater input than the one before, or a smaller one, the order is that of the input.
    Otherwise, sorted by the input, the output is smoother than in the order of the rows.

    Parameters
    ----------
    u, y : ndarray, shape (points,)
        Missing values are left out.
    """
    known = np.isfinite(u) & np.isfinite(y)
    u, y = u[known], y[known]
    if u.size < _LEAST_POINTS or not np.ptp(y) > 0.0:
        return False
    steps = np.diff(u)
    if (steps > 0.0).all() or (steps < 0.0).all():
        return True
    order = np.argsort(u, kind="stable")
    on_curve, in_file = (
        _measure_roughness(u[order], y[order]),
        _measure_roughness(np.arange(float(u.size)), y),
    )
    return on_curve <= min(_BETTER * in_file, _NEAR * float(np.std(y)))


def _measure_roughness(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Return the root mean square distance of the inner points from the line through their neighbours."""
    width = x[2:] - x[:-2]
    # Of points at one place, the mean of the neighbours counts.
    part = np.divide(x[1:-1] - x[:-2], width, out=np.full(width.size, 0.5), where=width > 0.0)
    return float(np.sqrt(np.mean((y[1:-1] - y[:-2] - part * (y[2:] - y[:-2])) ** 2)))


def describe_static_curve(file: str, input_name: str, output_name: str) -> str:
    """State that the points of a curve have no time, and how a static model of them is fitted."""
    return join_text(
        f"{file}: {output_name} is a static curve over {input_name}: the file has no time, and the order of "
        "its rows plays no visible part. For a static model of the points, in which the sampling time plays "
        "none either, write the rows in random order and give ",
        name_option("dt", 1),
        ". If the rows follow each other in time, give the sampling time by it",
    )
