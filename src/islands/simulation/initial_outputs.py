"""Estimation of the initial outputs of a free run.

A free run starts from the first measured outputs. Their noise decays with the memory of the model: an
integrator keeps it throughout the run, and a slow mode multiplies it. Of an integrator with a second pole of
0.967, noise of 0.0005 in the first two samples is an error of about 0.02 in the whole run, while the
simulation with the true initial state has an error of 0.0005.

The initial outputs are therefore estimated from the first part of every segment, where that noise matters.
The same rule applies to all models of one output and to all uses of a free run: scores, bands, figures and
simulations.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from islands.kernels.state_space import simulate_state_space
from islands.models.coupled_narx import AnyModel
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.records.coupled import AnyRecord
from islands.records.dataset import Dataset, join
from islands.records.signal_map import map_signals, match_rate
from islands.rounding import NORMAL_MEDIAN
from islands.simulation.initial_states import estimate_first_states
from islands.simulation.predictors import Simulation, free_run

#: Samples of a segment from which its initial outputs are estimated: at least this number, and this part.
_LEAST_SAMPLES, _PART = 100, 0.1

#: The initial outputs are estimated if their noise contributes more than this part of the mean squared error.
LEAST_SHARE = 0.2

#: Largest change of an initial output in standard deviations of the noise; a larger one has other reasons.
_LARGEST_CHANGE = 4.0

#: Step of a difference of initial outputs as a fraction of the output range.
STEP = 1e-4

#: Linearisations of a model that is not linear in its past outputs.
_ITERATIONS = 3

#: Change of an initial output in standard deviations of the noise that ends the iteration.
_NEGLIGIBLE = 1e-3


#: Statement about a free run whose initial outputs are estimated.
ESTIMATED_START = (
    "the initial outputs are estimated from the first samples, because the noise of the measured ones has an "
    "effect on the whole free run"
)


def simulate_freely(model: AnyModel, record: AnyRecord, warm_up: int | None = None) -> Simulation:
    """Simulate every segment from its estimated initial outputs; see `estimate_initial_outputs`.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    record : Dataset or CoupledRecord
    warm_up : int or None
        Number of samples before the first prediction. None is the model's largest lag.

    Raises
    ------
    ModelError, RecordError, SettingsError
        As for `free_run`.
    """
    return free_run(model, estimate_initial_outputs(model, record, warm_up), warm_up)


def has_estimated_start(model: AnyModel, record: AnyRecord, warm_up: int | None = None) -> bool:
    """Return whether `simulate_freely` starts from estimated outputs."""
    return estimate_initial_outputs(model, record, warm_up) is not record


def estimate_initial_outputs(
    model: AnyModel, record: AnyRecord, warm_up: int | None = None, least_share: float = LEAST_SHARE
) -> AnyRecord:
    """Return the record with estimated outputs before the first prediction of every segment.

    The estimate is that of least squares on the first 100 samples of a segment, or on the first tenth of a
    longer one, with the initial outputs as further measurements. For a latent model, they are the outputs of
    the states that this part shows. The record itself is returned if the model has several outputs, if the
    noise of the initial outputs contributes at most ``least_share`` of the mean squared error, or if an
    estimate differs from the measurement by more than noise. The noise is at most the error of the free run
    from the estimate, and at most what the third differences of the output permit, so that the error of a
    model is not taken for noise.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    record : Dataset or CoupledRecord
        Only known outputs are used.
    warm_up : int or None
        Number of samples before the first prediction. None is the model's largest lag.
    least_share : float
        With 0, the initial outputs are estimated however small the effect of their noise is.

    Returns
    -------
    Dataset or CoupledRecord
        At the rate of the model if it was estimated.

    Raises
    ------
    ModelError, RecordError, SettingsError
        As for `free_run`.
    """
    if not isinstance(model, Model | LatentModel) or not isinstance(record, Dataset):
        return record
    first = model.maximum_lag if warm_up is None else warm_up
    # A warm-up that is too short, or a model without parameters, is an error of the free run.
    if model.theta is None or not isinstance(first, int) or first < model.maximum_lag:
        return record
    if isinstance(model, LatentModel):
        return _simulate_start(model, record, first)
    return _estimate(model, record, first, least_share)


# Scores, bands and figures of one model on one record share the estimate.
@lru_cache(maxsize=32)
def _simulate_start(model: LatentModel, record: Dataset, first: int) -> Dataset:
    """Return the record with the outputs of estimated states before the first predictions."""
    at_rate = match_rate(model, record)
    signals, offset = map_signals(model, at_rate)
    y = np.array(at_rate.y)
    for begin, end in at_rate.bounds:
        last = min(end, begin + first + _window(end - begin))
        if end - begin > first and not np.isnan(at_rate.y[begin + first : last]).all():
            states, u = estimate_first_states(model, signals, begin, last)
            late = last - begin - len(u)
            run = np.empty(first - late)
            simulate_state_space(model.theta, model.codes, u[: first - late], states.copy(), run)
            y[begin + late : begin + first] = run + offset
    started = replace(at_rate, y=y)
    before, after = (_window_error(model, begun, at_rate, first) for begun in (at_rate, started))
    return started if after < before else record


# As above.
@lru_cache(maxsize=32)
def _estimate(model: Model, record: Dataset, first: int, least_share: float) -> Dataset:
    depth = model.output_lag
    at_rate = match_rate(model, record)
    step = STEP * at_rate.output_range if depth else 0.0
    segments = count_segments(at_rate, first)
    if not (step > 0.0 and segments):
        return record
    # Statistics of very large numbers overflow; such an estimate is not accepted.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        changes: NDArray[np.float64] = np.zeros((segments, depth))
        for iteration in range(_ITERATIONS):
            started = change_initial_outputs(at_rate, changes, first)
            solution = _linearise(model, started, at_rate.y, changes, first, step)
            if solution is None:
                return record
            solved, noise, share = solution
            if iteration == 0:
                noise = min(noise, _bound_noise(at_rate))
                if not share * noise**2 > least_share:
                    return record
            moved = np.abs(solved - changes).max()
            changes = solved
            if not np.abs(changes).max() <= _LARGEST_CHANGE * noise:
                return record
            if moved <= _NEGLIGIBLE * noise:
                break
        started = change_initial_outputs(at_rate, changes, first)
        before, after = (_window_error(model, begun, at_rate, first) for begun in (at_rate, started))
        return started if after < before else record


def change_initial_outputs(record: Dataset, changes: NDArray[np.float64], first: int) -> Dataset:
    """Return the record with changed outputs before the first predictions.

    Parameters
    ----------
    record : Dataset
    changes : ndarray, shape (segments, outputs)
        Changes for every segment that is longer than the warm-up, that of the latest output first.
    first : int
        Samples of the warm-up.
    """
    if not changes.any():
        return record
    y, rows = np.array(record.y), iter(changes)
    for begin, end in record.bounds:
        if end - begin > first:
            for lag, change in enumerate(next(rows), start=1):
                y[begin + first - lag] += change
    return replace(record, y=y)


# All models of a record share the bound.
@lru_cache(maxsize=8)
def _bound_noise(record: Dataset) -> float:
    """Return a bound of the standard deviation of white noise of the output, from its third differences.

    The differences of a smooth output are small, and the median ignores its jumps.
    """
    differences = [np.diff(record.y[begin:end], 3) for begin, end in record.bounds]
    known = np.concatenate(differences)
    known = np.abs(known[~np.isnan(known)])
    # The variance of a third difference is 20 times that of the noise.
    return float(np.median(known) / (NORMAL_MEDIAN * 20.0**0.5)) if known.size else 0.0


def count_segments(record: Dataset, first: int) -> int:
    """Return the number of segments that are longer than a warm-up of ``first`` samples."""
    return sum(end - begin > first for begin, end in record.bounds)


@lru_cache(maxsize=8)
def _perturb(record: Dataset, depth: int, first: int, step: float) -> Dataset:
    """Return copies of a record: unchanged, and with one initial output of every segment changed."""
    segments = count_segments(record, first)
    steps = step * np.eye(depth)
    copies = [change_initial_outputs(record, np.tile(change, (segments, 1)), first) for change in steps]
    return join((replace(record, recordings=()), *(replace(copy, recordings=()) for copy in copies)))


def _linearise(
    model: Model,
    record: Dataset,
    y: NDArray[np.float64],
    changes: NDArray[np.float64],
    first: int,
    step: float,
) -> tuple[NDArray[np.float64], float, float] | None:
    """Return better changes, the noise with them, and the factor of its variance in the mean squared error.

    None if a simulation diverges, or if the effects of the initial outputs are equal up to rounding.
    """
    depth = changes.shape[1]
    run = free_run(model, _perturb(record, depth, first, step), first)
    # The error is infinite after a divergence only; NaN if outputs are missing.
    if not run.outcome:
        return None
    base, *moved = run.y.reshape(depth + 1, -1)
    slopes = (np.array(moved) - base) / step
    solved, squares, count = np.empty_like(changes), 0.0, 0
    total, samples, gain = 0.0, 0, 0.0
    kept = ((begin + first, end) for begin, end in record.bounds if end - begin > first)
    for place, (begin, end) in enumerate(kept):
        rows = np.flatnonzero(~np.isnan(y[begin:end])) + begin
        window = rows[rows < begin + _window(end - begin)]
        columns, error = slopes[:, window], y[window] - base[window]
        # The initial outputs themselves are measured, too.
        normal = np.eye(depth) + np.einsum("ik,jk->ij", columns, columns)
        right = np.einsum("ik,k->i", columns, error) - changes[place]
        try:
            further = np.linalg.solve(normal, right)
        except np.linalg.LinAlgError:
            return None
        solved[place] = changes[place] + further
        left = y[rows] - base[rows] - np.einsum("i,ik->k", further, slopes[:, rows])
        squares += float(np.add.reduce(left[: window.size] ** 2) + np.add.reduce(solved[place] ** 2))
        count += window.size
        total += float(np.add.reduce(left**2))
        gain += float(np.einsum("ik,ik->", slopes[:, rows], slopes[:, rows]))
        samples += rows.size
    if count <= depth or not np.isfinite(squares):
        return None
    share = gain / max(total, np.finfo(float).tiny)
    return solved, (squares / count) ** 0.5, share


def _window(samples: int) -> int:
    """Return the number of samples of a segment from which its initial outputs are estimated."""
    return max(_LEAST_SAMPLES, round(_PART * samples))


def _window_error(model: DynamicModel, started: Dataset, record: Dataset, first: int) -> float:
    """Return the sum of squares of a free run over the samples of the estimate."""
    run = free_run(model, started, first)
    if not run.outcome:
        return np.inf
    error = record.y - run.y
    parts = [
        error[begin + first : min(end, begin + first + _window(end - begin - first))]
        for begin, end in record.bounds
    ]
    return float(np.nansum(np.concatenate(parts) ** 2))
