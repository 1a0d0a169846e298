"""Multiple shooting: a simulation restarts at regular intervals from states that are fitted to the output.

After Bock, with the states eliminated: they are fitted within each simulation by the Gauss-Newton method, all
intervals at once, since the states of one interval do not affect the others.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.effects.interface.context import Signal
from islands.errors import RecordError
from islands.expressions.tree import Symbol
from islands.records.dataset import Dataset
from islands.records.segments import map_segments
from islands.simulators.ode.kernel_arguments import LANES, MANY_LANES, LaneRestarts, LaneSignals
from islands.simulators.ode.lane_simulation import count_samples, integrate_group, list_signals
from islands.simulators.ode.lane_values import LaneInput, LaneValues
from islands.simulators.ode.program import OdeProgram
from islands.simulators.ode.sampled_signal import SampledSignal, chain_signals
from islands.simulators.ode.system import OdeSystem

#: Time of a call of the kernel, in intervals of `LANES` lanes.
_CALL_TIME = 1.0

#: Time of an interval by number of lanes.
_TIMES = {LANES: 1.0, MANY_LANES: 1.3}

#: Smallest number of samples in a shooting interval.
MIN_SAMPLES = 20

#: Smallest number of intervals in a record.
MIN_INTERVALS = 4

#: Window of the Savitzky-Golay filter that smooths the measured output, in samples.
SMOOTHING_WINDOW = 9

#: Change of a state for its response, relative to its size.
_STEP = 1e-4

#: Maximum number of Gauss-Newton steps.
_ITERATIONS = 3

#: Lengths of each step that are tried in each interval.
_STEP_LENGTHS = (1.0, 0.4, 0.15)

#: Part of the promised decrease at which no shorter step is tried.
_SUFFICIENT_DECREASE = 0.5

#: Least promised decrease of the sum of squares of an interval for another step, relative to their mean. The
#: outputs for finite differences must not depend on the number of steps.
_MIN_DECREASE = 1e-8

#: Responses whose energy in other directions is a smaller part are not distinguished.
_RANK_TOLERANCE = 1e-12


class IntervalSimulation:
    """Simulation of lanes that restart at the same samples.

    Parameters
    ----------
    program, dt, lanes, every
        As of `simulate_lanes`; ``every`` is a divisor of ``interval``.
    restarted : sequence of str
        States that are given at each restart, the first ones of the program; others are kept.
    interval : int
        Samples of an interval; the last one may be shorter.
    """

    def __init__(
        self,
        program: OdeProgram,
        dt: float,
        lanes: Sequence[LaneInput],
        restarted: Sequence[str],
        interval: int,
        every: int = 1,
    ) -> None:
        assert tuple(restarted) == tuple(program.states[: len(restarted)])
        self._program, self._dt, self.lanes = program, dt, lanes
        self._values = LaneValues(program, lanes)
        self._interval, self._every = interval, every
        elements = lanes[0].elements
        has_state = elements is not None and bool(elements.state_derivatives.any())
        self.is_independent = len(restarted) == len(program.states) and not has_state
        self._count = -(-count_samples(lanes) // interval)
        found, indices = list_signals(program.signals, dt, lanes)
        self._signals = _chain(tuple(found), self._count * interval)
        self._places = 3 * self._count * interval * indices

    def simulate(
        self, lanes: NDArray[np.int64], states: Signal, is_asked: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Simulate intervals.

        Parameters
        ----------
        lanes : ndarray of int64, shape (runs,)
            Index of the lane of each run.
        states : ndarray, shape (runs, intervals, restarted)
            States at the start of each interval.
        is_asked : ndarray of bool, shape (runs, intervals)
            The intervals to be simulated. If they depend on one another, all of them are.

        Returns
        -------
        ndarray, shape (runs, outputs, intervals, interval // every)
            NaN for intervals that are not simulated; not finite where a simulation diverges.
        """
        outputs = self._program.instructions.outputs.size
        found = np.full((len(lanes), outputs, self._count, self._interval // self._every), np.nan)
        runs, intervals, width = self._plan_columns(is_asked)
        if not runs.size:
            return found
        rows = intervals.shape[1]
        size = rows * self._interval
        restarts = np.arange(0, size, self._interval)
        shared = np.empty((size, 3, 0))
        order = np.arange(len(self._program.signals))
        out = np.empty((size // self._every, outputs, width))
        for first in range(0, len(runs), width):
            # The last column is repeated in the lanes that are left over.
            columns = np.minimum(np.arange(first, first + width), len(runs) - 1)
            given = states[runs[columns, None], intervals[columns]].transpose(1, 2, 0)
            offsets = 3 * self._interval * intervals[columns].T[:, None]
            signals = LaneSignals(
                shared,
                self._signals,
                np.ascontiguousarray(offsets + self._places[lanes[runs[columns]]].T),
            )
            run, places = runs[first : first + width], intervals[first : first + width]
            integrate_group(
                self._program,
                self._values,
                lanes[run],
                signals,
                order,
                LaneRestarts(restarts, np.ascontiguousarray(given.reshape(rows, -1))),
                self._dt,
                0,
                self._every,
                out,
            )
            parts = out[..., : len(run)].reshape(rows, -1, outputs, len(run))
            found[run[:, None], :, places] = parts.transpose(3, 0, 2, 1)
        return found

    def _plan_columns(self, is_asked: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
        """Return the run of each lane of the kernel, and the intervals that it simulates one after another.

        Returns
        -------
        ndarray of int64, shape (columns,)
        ndarray of int64, shape (columns, rows)
            The last interval is repeated where fewer are asked for.
        int
            Number of lanes of the kernel.
        """
        if not self.is_independent:
            runs = np.flatnonzero(is_asked.any(axis=1))
            return runs, np.tile(np.arange(self._count), (runs.size, 1)), LANES
        counts = np.count_nonzero(is_asked, axis=1)
        if not counts.any():
            return np.empty(0, dtype=np.int64), np.empty((0, 1), dtype=np.int64), LANES
        rows = np.arange(1, counts.max() + 1)
        columns = np.sum(-(-counts // rows[:, None]), axis=1)
        times = {lanes: -(-columns // lanes) * (rows * time + _CALL_TIME) for lanes, time in _TIMES.items()}
        width = min(times, key=lambda lanes: times[lanes].min())
        best = int(rows[np.argmin(times[width])])
        runs, places = np.nonzero(is_asked)
        columns = -(-counts // best)
        # Intervals of a run follow one another; its last one fills what remains of its last column.
        ends, sizes = np.cumsum(counts), columns * best
        rank = np.arange(places.size) - np.repeat(ends - counts, counts)
        found = np.repeat(places[ends - 1], sizes)
        found[np.repeat(np.cumsum(sizes) - sizes, counts) + rank] = places
        return np.repeat(np.arange(counts.size), columns), found.reshape(-1, best), width


@lru_cache(maxsize=4)
def _chain(signals: tuple[SampledSignal, ...], samples: int) -> Signal:
    """Return signals that calls have in common, as `chain_signals`."""
    return chain_signals(signals, samples)


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

    def make_simulation(
        self,
        program: OdeProgram,
        dt: float,
        lanes: Sequence[LaneInput],
        initial: Mapping[str, float],
        every: int,
    ) -> "ShotSimulation":
        """Make the simulation of lanes whose states at the intervals are the guesses, or the initial states.

        Parameters
        ----------
        program, dt, lanes
            As of `simulate_lanes`.
        initial : mapping
            States that restart, with their values at intervals without a guess.
        every : int
            Steps of a sample.
        """
        count = -(-self.measured.size // self.interval)
        starts = {
            name: self.guesses[name][:: self.interval]
            if name in self.guesses
            else np.full(count, initial[name])
            for name in program.states
            if name in initial
        }
        simulation = IntervalSimulation(program, dt, lanes, list(starts), self.interval * every, every)
        return ShotSimulation(simulation, self.measured, self.interval, starts)


@dataclass(frozen=True, slots=True, eq=False)
class ShotSimulation:
    """Simulation of lanes that restart at shooting intervals.

    Attributes
    ----------
    simulation : IntervalSimulation
    measured : ndarray, shape (samples,)
    interval : int
        Samples of an interval.
    starts : mapping
        States at the intervals before they are fitted, each of shape (intervals,).
    """

    simulation: IntervalSimulation
    measured: Signal
    interval: int
    starts: Mapping[str, Signal]

    def simulate_starts(self) -> Signal:
        """Simulate with the states before they are fitted; return the outputs, (lanes, outputs, samples)."""
        states = self._list_states()
        found = self.simulation.simulate(
            np.arange(len(states)), states, np.ones(states.shape[:2], dtype=bool)
        )
        return found.reshape(*found.shape[:2], -1)[..., : self.measured.size]

    def _list_states(self) -> Signal:
        """Return the states before they are fitted, shape (lanes, intervals, states)."""
        return np.array([np.column_stack(list(self.starts.values()))] * len(self.simulation.lanes))

    def fit_states(self, sizes: Mapping[str, float], near: Sequence[int | None]) -> Signal:
        """Fit the states of all intervals in each lane, and return the first output, shape (lanes, samples).

        Parameters
        ----------
        sizes : mapping
            Sizes of the states that are fitted.
        near : sequence of int or None
            For a lane that is a small change of another one, the index of that lane. If intervals are
            independent, it has the states of that lane, and its output changes as with fitted states to first
            order: by what changes of the states cannot compensate (variable projection; Kaufman, 1975).
        """
        moves = _STEP * np.array([[sizes[own] * (own == name) for name in self.starts] for own in sizes])
        bases = np.array([lane if base is None else base for lane, base in enumerate(near)])
        is_near = self.simulation.is_independent & (bases != np.arange(len(near)))
        fitted, others = np.flatnonzero(~is_near), np.flatnonzero(is_near)
        y, states = self._fit(fitted, moves)
        if not others.size:
            return self._join(y)
        responses = self._respond(fitted, states, moves, y)
        inverse = _invert(responses)
        base = np.searchsorted(fitted, bases[others])
        changed = self._simulate(others, states[base])
        steps, _ = _find_steps(responses[:, base], inverse[base], y[base] - changed)
        outputs = np.empty((len(near), *y.shape[1:]))
        outputs[fitted] = y
        outputs[others] = changed + np.einsum("aril,ria->ril", responses[:, base], steps)
        return self._join(outputs)

    def _fit(self, lanes: NDArray[np.int64], moves: Signal) -> tuple[Signal, Signal]:
        """Return the outputs, shape (lanes, intervals, interval), with fitted states, and these."""
        states = self._list_states()[lanes]
        measured = np.pad(self.measured, (0, -self.measured.size % self.interval)).reshape(-1, self.interval)
        is_active = np.ones(states.shape[:2], dtype=bool)
        y = self._simulate(lanes, states)
        error = _sum_squares(measured - y)
        for _ in range(_ITERATIONS):
            if not is_active.any():
                break
            responses = self._respond(lanes, states, moves, y, is_active)
            inverse = _invert(responses)
            steps, promised = _find_steps(responses, inverse, measured - y)
            first, before, is_tried = states, error, is_active
            # Where a mass sticks the response is nonlinear, and a full step may increase the error.
            for length in _STEP_LENGTHS:
                if not is_tried.any():
                    break
                trial = first + length * (steps @ moves)
                output = self._simulate(lanes, trial, is_tried)
                found = _sum_squares(measured - output)
                is_better = is_tried & (found < error)
                states = np.where(is_better[..., None], trial, states)
                y = np.where(is_better[..., None], output, y)
                error = np.where(is_better, found, error)
                is_tried = is_tried & (before - error < _SUFFICIENT_DECREASE * promised)
            _, promised = _find_steps(responses, inverse, measured - y)
            least = _MIN_DECREASE * np.mean(error, axis=1, keepdims=True)
            is_active = is_active & (error < before) & (promised > least)
        return y if self.simulation.is_independent else self._simulate(lanes, states), states

    def _respond(
        self,
        lanes: NDArray[np.int64],
        states: Signal,
        moves: Signal,
        y: Signal,
        is_asked: NDArray[np.bool_] | None = None,
    ) -> Signal:
        """Return the changes of outputs by moves of the states, shape (moves, lanes, intervals, interval)."""
        moved = (states + moves[:, None, None]).reshape(-1, *states.shape[1:])
        asked = None if is_asked is None else np.tile(is_asked, (len(moves), 1))
        outputs = self._simulate(np.tile(lanes, len(moves)), moved, asked)
        return np.nan_to_num(outputs.reshape(len(moves), *y.shape) - y)

    def _simulate(
        self, lanes: NDArray[np.int64], states: Signal, is_asked: NDArray[np.bool_] | None = None
    ) -> Signal:
        """Return the outputs, shape (lanes, intervals, interval): NaN if not asked for, 0 after the end."""
        asked = np.ones(states.shape[:2], dtype=bool) if is_asked is None else is_asked
        outputs = self.simulation.simulate(lanes, states, asked)[:, 0]
        outputs[:, -1, self.measured.size - self.interval * (states.shape[1] - 1) :] = 0.0
        return outputs

    def _join(self, y: Signal) -> Signal:
        return y.reshape(len(y), -1)[:, : self.measured.size]


def _sum_squares(residual: Signal) -> Signal:
    """Return the sum of squares of each interval; infinity if it is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.nan_to_num(np.einsum("...l,...l", residual, residual), nan=np.inf)


def _find_steps(responses: Signal, inverse: Signal, residual: Signal) -> tuple[Signal, Signal]:
    """Return the Gauss-Newton step in each interval, and the decrease of the squares that it promises.

    Parameters
    ----------
    responses : ndarray, shape (states, lanes, intervals, interval)
    inverse : ndarray, shape (lanes, intervals, states, states)
        Inverse of the products of responses.
    residual : ndarray, shape (lanes, intervals, interval)
    """
    slope = np.einsum("aril,ril->ria", responses, np.nan_to_num(residual))
    steps = np.einsum("riab,rib->ria", inverse, slope)
    return steps, np.einsum("ria,ria->ri", slope, steps)


def _invert(responses: Signal) -> Signal:
    """Return the pseudoinverses of the products of responses, shape (lanes, intervals, states, states)."""
    squares = np.einsum("aril,bril->riab", responses, responses)
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
    # Signals are padded to whole intervals: of samples of a nanosecond an interval would not fit into memory.
    interval = min(round(system.shooting / record.dt), max(record.segments))
    return Shots(max(MIN_SAMPLES, interval), record.y, guesses)


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
