"""Multiple shooting: a simulation restarts at regular intervals from states that are fitted to the output.

After Bock, with the states eliminated: they are fitted within each simulation by the Gauss-Newton method, all
intervals at once, since the states of one interval do not affect the others.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.discrepancy.interfaces.context import Signal
from islands.discrepancy.interfaces.segments import map_segments
from islands.errors import RecordError
from islands.systems.ode.interval_simulation import IntervalSimulation
from islands.systems.ode.lane_simulation import LaneInput
from islands.systems.ode.ode_expression import Symbol
from islands.systems.ode.ode_program import OdeProgram
from islands.systems.ode.ode_system import OdeSystem

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

    def fit_states(self, sizes: Mapping[str, float]) -> Signal:
        """Fit the states of all intervals in each lane, and return the first output, shape (lanes, samples).

        Parameters
        ----------
        sizes : mapping
            Sizes of the states that are fitted.
        """
        samples, states = self.measured.size, self._list_states()
        lanes = np.arange(len(states))
        measured = np.pad(self.measured, (0, -samples % self.interval)).reshape(-1, self.interval)
        last = samples - self.interval * (len(measured) - 1)
        moves = _STEP * np.array([[sizes[own] * (own == name) for name in self.starts] for own in sizes])

        def simulate(points: Signal, is_asked: NDArray[np.bool_]) -> Signal:
            """Simulate points of shape (points, lanes, intervals, states); NaN where nothing is asked for."""
            runs, asked = np.tile(lanes, len(points)), np.tile(is_asked, (len(points), 1))
            outputs = self.simulation.simulate(runs, points.reshape(-1, *states.shape[1:]), asked)[:, 0]
            outputs[:, -1, last:] = 0.0
            return outputs.reshape(len(points), lanes.size, *measured.shape)

        is_active = np.ones(states.shape[:2], dtype=bool)
        y = simulate(states[None], is_active)[0]
        error = _sum_squares(measured - y)
        for _ in range(_ITERATIONS):
            responses = np.nan_to_num(simulate(states + moves[:, None, None], is_active) - y)
            inverse = _invert(np.einsum("aril,bril->riab", responses, responses))
            steps, promised = _find_steps(responses, inverse, measured - y)
            first, before, is_tried = states, error, is_active
            # Where a mass sticks the response is nonlinear, and a full step may increase the error.
            for length in _STEP_LENGTHS:
                trial = first + length * (steps @ moves)
                (output,) = simulate(trial[None], is_tried)
                found = _sum_squares(measured - output)
                is_better = found < error
                states = np.where(is_better[..., None], trial, states)
                y = np.where(is_better[..., None], output, y)
                error = np.where(is_better, found, error)
                is_tried = is_tried & (before - error < _SUFFICIENT_DECREASE * promised)
            _, promised = _find_steps(responses, inverse, measured - y)
            least = _MIN_DECREASE * np.mean(error, axis=1, keepdims=True)
            is_active = is_active & (error < before) & (promised > least)
        if not self.simulation.is_independent:
            y = simulate(states[None], np.ones_like(is_active))[0]
        return y.reshape(lanes.size, -1)[:, :samples]


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


def _invert(squares: Signal) -> Signal:
    """Return the pseudoinverses of scaled matrices, shape (lanes, intervals, states, states)."""
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
