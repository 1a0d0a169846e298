"""Baseline of the benchmark: an evaluation as a good programmer writes it in plain numpy.

It stacks columns, selects forward by textbook modified Gram-Schmidt, calls lstsq, and loops in Python over
the steps of a shooting interval on vectors of all intervals. Expressions are Python functions that are made
once per individual. Walking the trees in the loop would double its time and flatter the kernels.
"""

from collections.abc import Callable, Sequence
from importlib.abc import InspectLoader
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.models.regressor import Regressor
from islands.records.dataset import Dataset
from lab.speed.expression_source import infix

Vector = NDArray[np.float64]

#: Tolerance of forward selection: so small that nearly every regressor is selected.
TOLERANCE = 1e-9


def evaluate(
    regressors: Sequence[Regressor],
    theta: Sequence[float],
    record: Dataset,
    warm_up: int,
    interval: int,
    pruned: bool,
) -> tuple[NDArray[np.floating[Any]], float]:
    """Evaluate an individual with one input.

    The results of forward selection and lstsq are not used for the simulation, as in the measurement of the
    kernels: both simulate the same model with the given parameters.

    Returns
    -------
    estimated : ndarray, shape (terms,)
        Least-squares estimate of the parameters.
    squared_error : float
        Sum of squared errors over all whole intervals.
    """
    matrix, target = columns(regressors, record, warm_up), record.y[warm_up:]
    if pruned:
        select(matrix, target)
    estimated = np.linalg.lstsq(matrix, target, rcond=None)[0]
    return estimated, simulate(regressors, theta, record, warm_up, interval)


def columns(regressors: Sequence[Regressor], record: Dataset, warm_up: int) -> NDArray[np.float64]:
    """Return the regressor matrix, shape (samples - warm_up, terms)."""
    signals = {"y": record.y, "u": record.u[:, 0]}
    first, end = warm_up, record.samples
    parts = [
        _make_function(item, "y, u", lambda name, lag: f"{name}[{first - lag}:{end - lag}]")(**signals)
        for item in regressors
    ]
    return np.column_stack([np.broadcast_to(part, end - first) for part in parts])


def select(matrix: NDArray[np.float64], target: Vector, tolerance: float = TOLERANCE) -> list[int]:
    """Return the columns in the order of their error reduction ratio, by modified Gram-Schmidt."""
    matrix, energy = matrix.copy(), target @ target
    selected: list[int] = []
    left = list(range(matrix.shape[1]))
    while left:
        ratios = [(matrix[:, j] @ target) ** 2 / (matrix[:, j] @ matrix[:, j]) / energy for j in left]
        best = int(np.argmax(ratios))
        if not ratios[best] > tolerance:
            break
        chosen = left.pop(best)
        selected.append(chosen)
        w = matrix[:, chosen]
        norm = w @ w
        for j in left:
            matrix[:, j] -= (w @ matrix[:, j]) / norm * w
    return selected


def simulate(
    regressors: Sequence[Regressor], theta: Sequence[float], record: Dataset, warm_up: int, interval: int
) -> float:
    """Simulate all whole intervals together; return the sum of squared errors."""
    terms = [
        (weight, _make_function(item, "y, u, k", lambda name, lag: f"{name}[k-{lag}]"))
        for weight, item in zip(theta, regressors, strict=True)
    ]
    lanes = (record.samples - warm_up) // interval
    samples = (np.arange(lanes) * interval)[None, :] + np.arange(warm_up + interval)[:, None]
    measured, u = record.y[samples], record.u[:, 0][samples]
    y = measured.copy()
    for k in range(warm_up, warm_up + interval):
        total: Any = 0.0
        for weight, term in terms:
            total = total + weight * term(y, u, k)
        y[k] = total
    return float(np.sum((y[warm_up:] - measured[warm_up:]) ** 2))


class _GeneratedSource(InspectLoader):
    """Loader of a module whose source is a string."""

    def __init__(self, source: str) -> None:
        self._source = source

    def get_source(self, _fullname: str) -> str:
        """Return the source."""
        return self._source


def _make_function(
    item: Regressor, arguments: str, sample: Callable[[str, int], str]
) -> Callable[..., Vector]:
    """Make the Python function that a programmer would write for a regressor.

    The function is imported from generated source, so that its bytecode is that of handwritten code. Closures
    that call each other took 2 to 5 % more CPU time on products and 8 to 11 % more on random trees; such a
    baseline would flatter the kernels.
    """
    source = infix(item.expression, lambda channel, lag: sample("yu"[channel], lag))
    module = ModuleType("regressor")
    vars(module)["sign"] = np.sign
    _GeneratedSource(f"def term({arguments}): return {source}").exec_module(module)
    term: Callable[..., Vector] = module.term
    return term
