"""Multiple shooting: a simulation restarts at regular intervals from states that are fitted to the output.

After Bock, with the states eliminated: they are fitted within each simulation by the Gauss-Newton method, all
intervals at once, since the states of one interval do not affect the others.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.discrepancy.interfaces.context import Signal
from islands.discrepancy.interfaces.segments import map_segments
from islands.errors import RecordError
from islands.systems.ode.ode_expression import Symbol
from islands.systems.ode.ode_system import OdeSystem

#: Smallest number of samples in a shooting interval.
MIN_SAMPLES = 20

#: Smallest number of intervals in a record.
MIN_INTERVALS = 4

#: Window of the Savitzky-Golay filter that smooths the measured output, in samples.
SMOOTHING_WINDOW = 9

#: Change of a state for its response, relative to its size.
_STEP = 1e-4

#: Number of Gauss-Newton steps.
_ITERATIONS = 3

#: Lengths of each step that are tried in each interval.
_STEP_LENGTHS = (1.0, 0.4, 0.15)

#: Responses whose energy in other directions is a smaller part are not distinguished.
_RANK_TOLERANCE = 1e-12

#: Simulates one output, shape (samples,), for each index of a run and its states at the intervals by name.
SimulateShots = Callable[[Sequence[tuple[int, Mapping[str, Signal]]]], Signal]


@dataclass(frozen=True, slots=True, eq=False)
class Shots:
    """Shooting intervals of a record.

    Attributes
    ----------
    interval : int
        Samples of an interval.
    measured : ndarray, shape (samples,)
        Measured output.
    guesses : mapping
        Estimates of states at every sample by name, each of shape (samples,).
    """

    interval: int
    measured: Signal
    guesses: Mapping[str, Signal]

    def for_samples(self, first: int, last: int) -> "Shots":
        """Return the intervals of one recording; one begins with it."""
        guesses = {name: signal[first:last] for name, signal in self.guesses.items()}
        return Shots(self.interval, self.measured[first:last], guesses)

    def get_starts(self, initial: Mapping[str, float]) -> dict[str, Signal]:
        """Return the states at the intervals before they are fitted; by default the initial ones."""
        count = -(-self.measured.size // self.interval)
        return {
            name: self.guesses[name][:: self.interval] if name in self.guesses else np.full(count, value)
            for name, value in initial.items()
        }

    def fit_states(
        self, simulate: SimulateShots, runs: int, starts: Mapping[str, Signal], sizes: Mapping[str, float]
    ) -> Signal:
        """Fit the states of all intervals, and return the outputs, shape (runs, samples).

        Parameters
        ----------
        simulate : callable
        runs : int
            Number of runs, each with other parameters.
        starts : mapping
            States at the intervals, before they are fitted.
        sizes : mapping
            Sizes of the states that are fitted.
        """

        def simulate_states(points: Signal) -> Signal:
            """Return the outputs of points, shape (points, runs, states, intervals)."""
            asked = [
                (run, {**starts, **dict(zip(sizes, values, strict=True))})
                for point in points
                for run, values in enumerate(point)
            ]
            return simulate(asked).reshape(len(points), runs, -1)

        place = np.arange(self.measured.size) // self.interval
        unit = _STEP * np.array(list(sizes.values()))
        states = np.array([[starts[name] for name in sizes]] * runs)
        for _ in range(_ITERATIONS):
            moved = states + np.diag(unit)[:, None, :, None]
            y, *moved_y = simulate_states(np.stack([states, *moved]))
            responses = np.nan_to_num(np.stack(moved_y, axis=1) - y[:, None])
            squares = _sum_intervals(responses[:, :, None] * responses[:, None], place)
            slope = _sum_intervals(responses * np.nan_to_num(self.measured - y)[:, None], place)
            step = unit[:, None] * np.einsum("krij,krj->rik", _invert(squares), slope)
            # Where a mass sticks the response is nonlinear, and a full step may increase the error.
            trials = np.stack([states, *(states + length * step for length in _STEP_LENGTHS)])
            outputs = np.concatenate([y[None], simulate_states(trials[1:])])
            errors = _sum_intervals((self.measured - outputs) ** 2, place)
            best = np.argmin(np.nan_to_num(errors, nan=np.inf), axis=1).T
            states = np.take_along_axis(trials, best[None, :, None], axis=0)[0]
            y = np.take_along_axis(outputs, best[None, :, place], axis=0)[0]
        return y


def _sum_intervals(signals: Signal, place: NDArray[np.int64]) -> Signal:
    """Sum signals of shape (..., samples) over each interval; the intervals come first in the result."""
    first = np.flatnonzero(np.diff(place, prepend=-1))
    return np.moveaxis(np.add.reduceat(signals, first, axis=-1), -1, 0)


def _invert(squares: Signal) -> Signal:
    """Return the pseudoinverses of scaled matrices, shape (intervals, runs, states, states)."""
    scale = np.sqrt(np.maximum(np.diagonal(squares, axis1=-2, axis2=-1), np.finfo(float).tiny))
    both = scale[..., :, None] * scale[..., None, :]
    return np.asarray(np.linalg.pinv(squares / both, rcond=_RANK_TOLERANCE, hermitian=True) / both)


def make_shots(system: OdeSystem, record: Dataset) -> Shots:
    """Make the shooting intervals of a record.

    A state that is the output starts at the measured output, its derivative at the smoothed rate.

    Raises
    ------
    RecordError
        The record is shorter than four intervals of the smallest size.
    """
    least = MIN_INTERVALS * MIN_SAMPLES
    if record.samples < least:
        raise RecordError(f"shooting needs {least} samples, the record has {record.samples}")
    if (shortest := min(record.segments)) < MIN_SAMPLES:
        raise RecordError(f"{system.name} needs {MIN_SAMPLES} samples of each recording, one has {shortest}")
    guesses = {}
    for name, right in system.derivatives:
        if system.output == Symbol(name):
            guesses[name] = record.y
            if isinstance(right, Symbol):
                guesses[right.name] = smooth(record.y, record, 1)
    return Shots(max(MIN_SAMPLES, round(system.shooting / record.dt)), record.y, guesses)


def smooth(signal: Signal, record: Dataset, order: int = 0, window: int = SMOOTHING_WINDOW) -> Signal:
    """Smooth a signal of a record, or its derivative of the given order.

    Parameters
    ----------
    signal : ndarray, shape (samples,)
    record : Dataset
    order : int
    window : int
        Window of the Savitzky-Golay filter in samples; at most those of the shortest recording.

    Raises
    ------
    RecordError
        A recording is shorter than `MIN_SAMPLES`.
    """
    if (shortest := min(record.segments)) < MIN_SAMPLES:
        raise RecordError(f"shooting needs {MIN_SAMPLES} samples of each recording, one has {shortest}")
    return map_segments(
        lambda part: scipy.signal.savgol_filter(part, window, 3, deriv=order, delta=record.dt),
        signal,
        record.segments,
    )
