"""Estimation of the initial states of a free run of a state space from the samples of its warm-up.

The states are not measured. They are those with which the simulation of the warm-up has the least squared
error; states that the warm-up does not show remain near rest, since all states have the same magnitude.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.kernels.state_estimation import find_nearest, minimise_error
from islands.kernels.state_space import simulate_state_space, trace_states
from islands.kernels.state_space_products import accumulate_products
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel
from islands.models.latent import LatentModel
from islands.records.coupled import AnyRecord, CoupledRecord
from islands.records.dataset import Dataset
from islands.records.signal_map import map_coupled_signals, map_signals

#: Weight of the measurement of the initial states, relative to the variance of the output of the states.
_RIDGE = 1e-3

#: Distance from rest at which an estimation also starts; the states have the magnitude 1.
_DISTANCE = 2.0

#: Steps of an estimation from several outputs, and the relative decrease of the error that ends it.
_SHARED_STEPS, _NEGLIGIBLE = 30, 1e-10

#: Rows from which each state is first estimated if the model diverges in the whole of them.
_FIRST_ROWS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """Consecutive rows of a record.

    Attributes
    ----------
    u : ndarray, shape (rows, inputs)
    y : ndarray, shape (rows,)
        NaN where it is missing.
    lower, upper : float
        Limits of the sensor.
    """

    u: NDArray[np.float64]
    y: NDArray[np.float64]
    lower: float = -np.inf
    upper: float = np.inf

    def take(self, begin: int, end: int | None) -> "Segment":
        """Return some of the rows."""
        return Segment(self.u[begin:end], self.y[begin:end], self.lower, self.upper)


def simulate_errors(
    theta: NDArray[np.float64], codes: NDArray[np.int64], segment: Segment, start: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the errors of a free run of a segment from initial states; None if it diverges.

    Parameters
    ----------
    theta, codes
        As of `StateSpaceFit`.
    segment : Segment
    start : ndarray, shape (states,)
        States at the first row.

    Returns
    -------
    ndarray, shape (rows,), or None
        NaN where the output is missing; zero where a limit is measured, and the simulation is beyond it.
    """
    y = np.empty(len(segment.y))
    if simulate_state_space(theta, codes, segment.u, start.copy(), y) < len(y):
        return None
    errors = segment.y - y
    beyond = (segment.y >= segment.upper) & (errors < 0.0) | (segment.y <= segment.lower) & (errors > 0.0)
    errors[beyond] = 0.0
    return errors


def estimate_states(
    theta: NDArray[np.float64], codes: NDArray[np.int64], segment: Segment, rest: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Estimate the states at the first row of a segment by least squares.

    Parameters
    ----------
    theta, codes
        As of `StateSpaceFit`.
    segment : Segment
    rest : ndarray, shape (states,)
        States at rest.

    Returns
    -------
    ndarray, shape (states,)
        The states move about those at rest with the magnitude 1, which is a weak measurement of each of them:
        a state that the rows do not show rests. The estimation starts at rest, and from another state that
        has a smaller error. If the model diverges from both, the states are estimated from the first rows,
        and then from more and more of them. All states rest if it still diverges.
    """
    fits = [
        _minimise(theta, codes, segment, start, rest) for start in _find_starts(theta, codes, segment, rest)
    ]
    found = min((fit for fit in fits if fit is not None), key=lambda fit: fit[0], default=None)
    if found is not None:
        return found[1]
    states, rows = rest, _FIRST_ROWS * len(rest)
    while rows < len(segment.y):
        part = segment.take(0, rows)
        states = _choose(_minimise(theta, codes, part, states, rest), states)
        rows *= 2
    return _choose(_minimise(theta, codes, segment, states, rest), rest).copy()


def _find_starts(
    theta: NDArray[np.float64], codes: NDArray[np.int64], segment: Segment, rest: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return the states at rest, and those about them that have the least error, if it is smaller.

    With units that read states, the error may have several minima.
    """
    if not codes.size:
        return [rest]
    moved = [rest + sign * _DISTANCE * row for row in np.eye(len(rest)) for sign in (1.0, -1.0)]
    starts = [rest, *moved]
    limits = segment.lower, segment.upper
    best = find_nearest(theta, codes, segment.u, segment.y, *limits, np.array(starts))
    return [rest, starts[best]] if best else [rest]


def _choose(
    found: tuple[float, NDArray[np.float64]] | None, other: NDArray[np.float64]
) -> NDArray[np.float64]:
    return other if found is None else found[1]


def _minimise(
    theta: NDArray[np.float64],
    codes: NDArray[np.int64],
    segment: Segment,
    start: NDArray[np.float64],
    rest: NDArray[np.float64],
) -> tuple[float, NDArray[np.float64]] | None:
    """Return the least error and its states; None if the model diverges at the start."""
    order = len(rest)
    weight = _RIDGE * float(np.sum(theta[order * (order + segment.u.shape[1]) :][:order] ** 2))
    states, limits = np.array(start), (segment.lower, segment.upper)
    least = minimise_error(theta, codes, segment.u, segment.y, *limits, rest, weight, states)
    return None if least == np.inf else (least, states)


def read_inputs(record: Dataset, model: LatentModel, begin: int, end: int) -> tuple[NDArray[np.float64], int]:
    """Return the inputs that act at the samples of a part of a segment, and how many samples lack one.

    An input that is read one sample early, or after a dead time, is not known at the first samples.

    Parameters
    ----------
    record : Dataset
    model : LatentModel
    begin, end : int
        First sample of a segment, and sample after the last one.

    Returns
    -------
    ndarray, shape (end - begin - late, inputs)
    int
    """
    late = max(model.input_lags)
    columns = [record.u[begin + late - lag : end - lag, place] for place, lag in enumerate(model.input_lags)]
    return np.column_stack(columns), late


def estimate_first_states(
    model: LatentModel, record: Dataset, begin: int, end: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimate the states at the first sample of a part of a segment whose inputs are known.

    Parameters
    ----------
    model : LatentModel
    record : Dataset
        Signals of the model.
    begin, end : int
        First sample of a segment, and sample after the last one that is used.

    Returns
    -------
    states : ndarray, shape (states,)
    u : ndarray, shape (rows, inputs)
        Inputs from the sample of the states on, as of `read_inputs`.
    """
    u, late = read_inputs(record, model, begin, end)
    segment = Segment(u, record.y[begin + late : end], *model.limits.range)
    return estimate_states(model.theta, model.codes, segment, model.rest), u


def estimate_initial_states(
    model: LatentModel, record: Dataset, start: NDArray[np.int64], warm_up: int
) -> NDArray[np.float64]:
    """Estimate the states before the first prediction of every interval.

    Parameters
    ----------
    model : LatentModel
    record : Dataset
        Signals of the model.
    start : ndarray of int64, shape (intervals,)
        First predicted samples.
    warm_up : int
        Number of samples before them.

    Returns
    -------
    ndarray, shape (intervals, states)
        States at the last sample of the warm-up; NaN if the model diverges before it, so that the free run
        diverges at its first sample.
    """
    if not model.order:  # one interval for every sample of a static model has as many estimates
        return np.empty((len(start), 0))
    parts = [(first - warm_up, first) for first in start.tolist()]
    return np.array([_continue(model, *estimate_first_states(model, record, *part)) for part in parts])


def _continue(model: LatentModel, x: NDArray[np.float64], u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the states at the last sample of the inputs; NaN if the model diverges before it."""
    rows = len(u) - 1
    bounded = simulate_state_space(model.theta, model.codes, u[:rows], x, np.empty(rows)) == rows
    return x if bounded else np.full(len(x), np.nan)


def estimate_coupled_states(
    model: CoupledLatentModel, records: Sequence[Dataset], start: NDArray[np.int64], warm_up: int
) -> NDArray[np.float64]:
    """Estimate the states of a model of several outputs before the first prediction of every interval.

    Parameters
    ----------
    model : CoupledLatentModel
    records : sequence of Dataset
        Signals of the model of every output.
    start, warm_up
        As for `estimate_initial_states`.

    Returns
    -------
    ndarray, shape (intervals, states)
        As of `estimate_initial_states`, in the order of the block.
    """
    pairs = [*zip(model.models, records, strict=True)]
    if not model.shares_states:
        return np.hstack([estimate_initial_states(*pair, start, warm_up) for pair in pairs])
    parts = [(first - warm_up, first) for first in start.tolist()]
    return np.array(
        [_continue(model.models[0], *_estimate_shared_states(model, records, *part)) for part in parts]
    )


def _estimate_shared_states(
    model: CoupledLatentModel, records: Sequence[Dataset], begin: int, end: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimate the states that all outputs share; see `estimate_first_states`.

    Every output weighs as much as its states do: the sum of the squared errors, each relative to the variance
    of its output for states of the magnitude 1, has the least sum with the squared distance from rest.
    """
    first = model.models[0]
    u, late = read_inputs(records[0], first, begin, end)
    rest, order, units = first.rest, first.order, len(first.units)
    # Outputs that can be written, as in all other calls of the kernel: it is compiled for each type.
    outputs = [
        (
            each.theta,
            record.y[begin + late : end].copy(),
            each.limits.range,
            float(each.matrices["C"] @ each.matrices["C"]),
        )
        for each, record in zip(model.models, records, strict=True)
    ]
    fixed, traces = np.full(first.theta.size, -1), np.empty((len(u), order + 2 * units, 1))
    products, none = np.empty((order + 1, order + 1)), np.empty((0, 0))
    best: NDArray[np.float64] = rest.copy()
    step: NDArray[np.float64] = np.zeros(order)
    least = np.inf
    for _ in range(_SHARED_STEPS):
        states = best + step
        total = np.full_like(products, np.inf)
        if trace_states(first.theta, first.codes, u, states.copy(), traces) == len(u):
            total[...] = 0.0
            for theta, y, limits, variance in outputs:
                accumulate_products(theta, fixed, units, traces, 0, u, y, *limits, 0, products, none)
                total += products / max(variance, 1e-300)
        error = total[order, order] + _RIDGE * float(np.sum((states - rest) ** 2))
        if error < least:
            decrease, best, least = least - error, states, error
            normal = total[:order, :order] + _RIDGE * np.eye(order)
            side = total[:order, order] - _RIDGE * (states - rest)
            step = np.asarray(np.linalg.solve(normal, side), np.float64)
            if decrease <= _NEGLIGIBLE * least:
                break
        elif least == np.inf:
            break
        else:
            step = 0.5 * step
    return best.copy(), u


def find_first_states(
    model: AnyModel, record: AnyRecord, warm_up: int
) -> tuple[int, dict[str, float]] | None:
    """Return the states from which an exported program repeats a free run of the first recording.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    record : Dataset or CoupledRecord
        As for `free_run`.
    warm_up : int
        Number of samples before the first prediction.

    Returns
    -------
    (int, dict of float) or None
        Sample, and the states there by name in the order of the program: after those of the model, the inputs
        as measured that it reads after a dead time. None for a model whose first outputs are given.
    """
    if isinstance(model, LatentModel) and isinstance(record, Dataset):
        pairs = [(model, map_signals(model, record)[0])]
    elif isinstance(model, CoupledLatentModel) and isinstance(record, CoupledRecord):
        pairs = [*zip(model.models, map_coupled_signals(model, record)[0].records, strict=True)]
    else:
        return None
    begin = next(begin for begin, end in record.bounds if end - begin > warm_up)
    late = max(max(single.input_lags) for single, _ in pairs)
    states: list[float] = []
    shares = isinstance(model, CoupledLatentModel) and model.shares_states
    for single, signals in pairs[:1] if shares else pairs:
        if isinstance(model, CoupledLatentModel) and shares:
            x, u = _estimate_shared_states(model, [each for _, each in pairs], begin, begin + warm_up)
        else:
            x, u = estimate_first_states(single, signals, begin, begin + warm_up)
        rows = late - max(single.input_lags)
        simulate_state_space(single.theta, single.codes, u[:rows], x, np.empty(rows))
        states += x.tolist()
    block, (single, signals) = model.block(), pairs[0]
    columns = dict(zip(block.signals[block.computed :], _measure_inputs(single, signals).T, strict=True))
    leads = dict(zip(block.signals, block.leads, strict=True))
    states += [columns[name][begin + late - lag - leads[name]] for name, lag in block.late_inputs]
    expanded = block.expand_delays()
    names = expanded.signals[expanded.outputs : expanded.computed]
    return begin + late, dict(zip(names, map(float, states), strict=True))


def _measure_inputs(model: LatentModel, signals: Dataset) -> NDArray[np.float64]:
    """Return the inputs of the signals of a model, as measured."""
    done = model.preprocessing
    return signals.u + np.array(done.input_offsets) if done else signals.u
