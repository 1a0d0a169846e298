"""What a coloured residual depends on that noise does not: tests before a residual is called noise.

A search for effects takes the colour of a residual for noise, and a coarse map of the input averages an error
that alternates over the input, such as that of a quantised actuator. The residual is therefore regressed on
free functions through the simulation: a fine map and a memory of the input, and a map of the output, for a
law of the state. Where the simulation itself is wrong, as for a sensor that shows the absolute value, curves
of the input after lags of several lengths are tried as well. Whatever has a frequency that moves, such as an
unmeasured force with a sweep, fills a band as noise does, but within a short window it is a line. Whatever
repeats with the periods of the input is no noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.noise_floor import split_periods
from islands.diagnosis.inference.noise_surrogates import (
    Randomisation,
    draw_surrogates,
    list_noise_models,
)
from islands.diagnosis.inference.pulse_response import convolve, respond_to_pulse
from islands.diagnosis.inference.residual_structure import MIN_DISTANCE, SHIFTS
from islands.effects.interface.context import Signal
from islands.kernels.linear_filter import filter_linearly
from islands.records.noise_model import fit_noise
from islands.records.segments import delay_samples, find_runs, map_segments

#: Number of cells of the map of the input. A sawtooth over the input needs three cells for each tooth.
CELLS = 120

#: The same of the output, for a law of the state. It has no teeth, and fewer cells are more sensitive to it.
OUTPUT_CELLS = 40

#: Least number of samples in a cell.
MIN_CELL_SAMPLES = 8

#: Lags of the memory, in samples.
MEMORY_LAGS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192)

#: Time constants of the lags whose curves are tried, in samples.
LAG_CONSTANTS = (1, 2, 4, 8, 16, 32, 64, 128)

#: Lengths of the windows in which a line is searched for, in samples, and the largest sweep in each, in
#: cycles per window.
WINDOWS = {128: 8, 256: 12, 512: 16, 1024: 32, 2048: 64}

#: Step of the sweeps that are tried, in cycles per window. A line is then at most half a cycle away.
SWEEP_STEP = 2

#: Largest number of samples in which lines are searched for: the time grows with it.
MAX_LINE_SAMPLES = 6000

#: Number of surrogates that lines and periods are compared with.
SURROGATES = 60

#: Distance from the surrogates above which a line is significant, in standard deviations. In 270 records with
#: clean coloured noise the largest one was 3.0, and 1 of 447 others was above this.
MIN_LINE_DISTANCE = 3.5


def find_hidden_structure(
    fit: CalibrationResult, target: Target, rng: np.random.Generator
) -> Mapping[str, float]:
    """Return what a residual depends on beyond chance, each with its distance in standard deviations.

    Parameters
    ----------
    fit : CalibrationResult
        The simulation whose residual may be noise.
    """
    distances = {
        **_compare_with_shifts(fit, target, rng),
        **_compare_with_surrogates(fit, target, rng),
    }
    least = {"moving frequency": MIN_LINE_DISTANCE}
    return {name: each for name, each in distances.items() if each > least.get(name, MIN_DISTANCE)}


def _compare_with_shifts(
    fit: CalibrationResult, target: Target, rng: np.random.Generator
) -> Mapping[str, float]:
    """Return the distances of regressions on functions of the input from those of circular shifts.

    Residual and functions are whitened, and what the parameters of the simulation reproduce is removed from
    both: otherwise estimates that coloured noise has moved look like a function of the input.
    """
    if fit.simulation.context.has_resting_input:
        return {}
    response = respond_to_pulse(fit)
    if response is None:
        return {}
    unweighted = (target.y - fit.output)[target.estimation_part]
    noise = fit_noise(unweighted, segments=target.fitted_segments)
    projection = Projection(fit, replace(target, noise=noise))
    count = unweighted.size
    residual = projection.residual[:count]
    shifted = np.column_stack(
        [np.roll(residual, shift) for shift in rng.integers(count // 20, count - count // 20, SHIFTS)]
    )
    distances = {}
    for name, functions in _list_functions(fit, target, response).items():
        columns = [projection(each)[:count] for each in functions]
        basis = _span(np.column_stack(columns))
        if basis.shape[1] == 0:
            continue
        null = np.log(np.sum((basis.T @ shifted) ** 2, axis=0))
        found = float(np.log(np.sum((basis.T @ residual) ** 2)))
        distances[name] = (found - float(null.mean())) / float(null.std())
    return distances


def _list_functions(fit: CalibrationResult, target: Target, response: Signal) -> Mapping[str, list[Signal]]:
    """Return responses to cells of the input and the output and to past inputs, and curves of lags."""
    context, fitted = fit.simulation.context, target.fitted
    lags = [lag for lag in MEMORY_LAGS if lag < fitted // 10]
    delayed = [map_segments(partial(delay_samples, lag=lag), context.u, context.segments) for lag in lags]
    functions = {
        "fine map of the input": _divide_into_cells(context.u, CELLS, fitted),
        "map of the output": _divide_into_cells(fit.output, OUTPUT_CELLS, fitted),
        "memory of the input": delayed,
    }
    responses = {
        name: [convolve(each, response, context.segments) for each in signals]
        for name, signals in functions.items()
    }
    return {**responses, "curve of a lag of the input": _list_curves(context.u, context.segments, fitted)}


def _list_curves(u: Signal, segments: Sequence[int], fitted: int) -> list[Signal]:
    """Return the square and the absolute value of the deviation of the input from its mean after each lag."""

    def lag(part: Signal, constant: int) -> Signal:
        weight = 1.0 / constant
        return np.asarray(filter_linearly([weight], [1.0, weight - 1.0], part))

    deviation = u - u[:fitted].mean()
    lagged = [
        map_segments(partial(lag, constant=constant), deviation, segments)
        for constant in LAG_CONSTANTS
        if constant < fitted // 10
    ]
    return [curve for each in lagged for curve in (each**2, np.abs(each))]


def _divide_into_cells(signal: Signal, most: int, fitted: int) -> list[Signal]:
    """Return where a signal is in each of up to ``most`` cells with equal numbers of samples, as 0 and 1."""
    count = min(most, fitted // MIN_CELL_SAMPLES)
    edges = np.unique(np.quantile(signal[:fitted], np.linspace(0.0, 1.0, count + 1)[1:-1]))
    cells = np.searchsorted(edges, signal, side="right")
    return [(cells == cell).astype(np.float64) for cell in range(edges.size + 1)]


def _span(columns: Signal) -> Signal:
    """Return an orthonormal basis of columns, shape (samples, dimensions)."""
    left, singular_values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, singular_values > 1e-6 * max(singular_values[0], np.finfo(float).tiny)])


def _compare_with_surrogates(
    fit: CalibrationResult, target: Target, rng: np.random.Generator
) -> Mapping[str, float]:
    """Return the distances of lines and of repetitions in the residual from those of surrogates.

    The longest part of the residual without a gap is analysed.
    """
    residual = (target.y - fit.output)[: target.fitted]
    runs = find_runs(~np.isnan(residual), fit.simulation.context.segments)
    first, last = max(runs, key=lambda run: run[1] - run[0])
    last = min(last, first + MAX_LINE_SAMPLES)
    part, u = residual[first:last], fit.simulation.context.u[first:last]
    noise = list_noise_models(part, ())[0]

    def draw(randomisation: Randomisation) -> Signal:
        return np.vstack([part, *draw_surrogates(part, noise, (), randomisation, SURROGATES, rng)])

    signals = draw(Randomisation.PHASES)
    found = [
        _measure_distance(_measure_lines(signals, length, largest))
        for length, largest in WINDOWS.items()
        if part.size >= length
    ]
    distances = {"moving frequency": max(found)} if found else {}
    if split_periods(u, part) is not None:
        # Random phases would keep the lines of a periodic residual.
        repeated = np.array([_measure_repetition(u, each) for each in draw(Randomisation.SIGNS)])
        distances["period of the input"] = _measure_distance(np.log(repeated))
    return distances


def _measure_distance(statistics: Signal) -> float:
    """Return the distance of the first value from the others, in their standard deviations."""
    null = statistics[1:]
    return float((statistics[0] - null.mean()) / max(float(null.std()), np.finfo(float).tiny))


def _measure_lines(signals: Signal, length: int, largest: int) -> Signal:
    """Return the mean fraction of the energy of windows that is a line with a constant sweep.

    Parameters
    ----------
    signals : ndarray, shape (signals, samples)
    length : int
        Length of the windows, half of which overlap.
    largest : int
        Largest sweep, in cycles per window.

    Returns
    -------
    ndarray, shape (signals,)
    """
    starts = range(0, signals.shape[1] - length + 1, length // 2)
    windows = np.stack([signals[:, start : start + length] for start in starts], axis=1)
    windows = (windows - windows.mean(axis=2, keepdims=True)) * np.hanning(length)
    energy = length * np.sum(windows**2, axis=2)
    time = (np.arange(length) - length / 2) / length
    best = np.zeros(energy.shape)
    for sweep in range(-largest, largest + 1, SWEEP_STEP):
        spectrum = np.abs(np.fft.fft(windows * np.exp(1j * np.pi * sweep * time**2))) ** 2
        spectrum = spectrum[..., 1 : length // 2]
        # The line of a Hann window is three frequencies wide.
        lines = spectrum[..., :-2] + spectrum[..., 1:-1] + spectrum[..., 2:]
        best = np.maximum(best, lines.max(axis=2))
    return np.asarray(np.mean(best / np.maximum(energy, np.finfo(float).tiny), axis=1))


def _measure_repetition(u: Signal, residual: Signal) -> float:
    """Return the variance of the mean period of a residual, relative to that of the differences from it."""
    periods = split_periods(u, residual)
    assert periods is not None
    mean = periods.mean(axis=0)
    return float(np.var(mean) / max(float(np.mean((periods - mean) ** 2)), np.finfo(float).tiny))
