"""Simulation that restarts at regular intervals from given states.

Unless a state is kept at the restarts, the intervals do not depend on one another, and are simulated side by
side.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from islands.simulators.ode.kernel_arguments import LANES, MANY_LANES, LaneRestarts, LaneSignals
from islands.simulators.ode.lane_simulation import count_samples, integrate_group, list_signals
from islands.simulators.ode.lane_values import LaneInput, LaneValues
from islands.simulators.ode.program import OdeProgram
from islands.simulators.ode.sampled_signal import SampledSignal, Signal, chain_signals

#: Time of a call of the kernel, in intervals of `LANES` lanes.
_CALL_TIME = 1.0

#: Time of an interval by number of lanes.
_TIMES = {LANES: 1.0, MANY_LANES: 1.3}


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
