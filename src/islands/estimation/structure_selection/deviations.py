"""Deviations of signals from their operating point, in which structures are selected.

The zero of a unit says nothing about a system whose signals are far from it: 20 degC is 293.15 K. Structures
are therefore selected in deviations from a value of the record, which is the same one in every unit. In the
units of the record, the powers of a pressure of 101300 Pa that varies by 100 Pa are proportional to each
other in floating point: their inner products have no digits left that distinguish them. A structure in
deviations is written in these units: a linear term requires a constant, and a product contains differences
such as ``u(k-1) - 101300``. Differences between lags do not change. Decision 0043 compares other choices.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from islands.estimation.parameter_constraints import constraint
from islands.expressions.primitives import SUB
from islands.expressions.tree import Apply, Constant, Expression, Lagged
from islands.models.narx import canonical_order
from islands.models.regressor import Regressor, regressor
from islands.records.dataset import Dataset

#: Median in standard deviations from which the powers of a signal are too similar for inner products.
LARGE_OFFSET = 30.0

#: Functions whose expressions keep their form in deviations: polynomials and differences of lags.
SHIFTABLE = frozenset({"mul", "add", "sub", "phi1", "phi2", "square", "cube"})

#: Offset of the output and of every input; 0 for a signal that is not taken as a deviation.
Offsets = tuple[float, ...]

_ONE = Constant(1.0)


def no_offsets(record: Dataset) -> Offsets:
    """Return offsets of 0."""
    return (0.0,) * (1 + record.inputs)


def find_offsets(record: Dataset, constraints: str = "none", least: float = 0.0) -> Offsets:
    """Return the medians of the signals that do not reach zero, and 0 for the others.

    A signal is left as it is if its median is not larger than ``least`` standard deviations, and all are
    under constraints that state something about the signals themselves.
    """
    if not constraint(constraints).allows_offsets:
        return no_offsets(record)
    return tuple(_find_offset(signal, least) for signal in (record.y[~np.isnan(record.y)], *record.u.T))


def _find_offset(signal: NDArray[np.float64], least: float) -> float:
    if signal.size < 2:
        return 0.0
    low, high = signal.min(), signal.max()
    # The limits of a uniform distribution are farther apart than the extremes of its samples (Lloyd, "Least
    # squares estimation of location and scale parameters using order statistics", Biometrika 39, 1952).
    beyond = (high - low) / (signal.size - 1)
    if low == high or low - beyond <= 0.0 <= high + beyond:
        return 0.0
    middle = float(np.partition(signal, signal.size // 2)[signal.size // 2])
    return middle if abs(middle) > least * np.std(signal - middle) else 0.0


def subtract_offsets(record: Dataset, offsets: Offsets) -> Dataset:
    """Return the record in deviations; the record itself if all offsets are 0."""
    if not any(offsets):
        return record
    return replace(record, y=record.y - offsets[0], u=record.u - np.array(offsets[1:]), sha256="")


def add_offsets(structure: Sequence[Regressor], offsets: Offsets) -> tuple[Regressor, ...]:
    """Express a structure in deviations in the units of the record, in canonical order."""
    if not any(offsets):
        return tuple(structure)
    restored: list[Regressor | None] = []
    constant = offsets[0] != 0.0
    for item in structure:
        if isinstance(item.expression, Lagged):
            constant |= offsets[item.expression.channel] != 0.0
            restored.append(item)
        else:
            restored.append(regressor(_subtract(item.expression, offsets))[1])
    if constant:
        restored.append(regressor(_ONE)[1])
    return tuple(canonical_order(item for item in restored if item))


def _subtract(expression: Expression, offsets: Offsets) -> Expression:
    match expression:
        case Lagged(channel, _) if offsets[channel]:
            return Apply(SUB, (expression, Constant(offsets[channel])))
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(_subtract(argument, offsets) for argument in arguments))
    return expression
