"""Segments of a record whose free runs are simulated together, one in each lane of a vector."""

from collections.abc import Iterable, Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from islands.kernels.simd import VECTOR
from islands.kernels.state_space import trace_states
from islands.kernels.state_space_lanes import sum_squared_errors, trace_lanes
from islands.simulation.initial_states import Segment, simulate_errors


class SegmentLanes(Sequence[Segment]):
    """Segments, also with their signals in lanes.

    Parameters
    ----------
    segments : iterable of Segment
        At least one, with the same inputs and limits of the sensor.

    Attributes
    ----------
    counts : ndarray of int64, shape (segments,)
        Measured outputs of each segment.
    """

    def __init__(self, segments: Iterable[Segment]) -> None:
        self._segments = tuple(segments)
        self.counts = np.array([np.count_nonzero(~np.isnan(segment.y)) for segment in self])
        # The lanes of one segment would take eight times its memory.
        lanes = 0 if len(self) == 1 else -(-len(self) // VECTOR) * VECTOR
        self._lengths = np.zeros(lanes, np.int64)
        if lanes:
            self._lengths[: len(self)] = [len(segment.y) for segment in self]
            self._u = np.zeros((max(self._lengths), self[0].u.shape[1], lanes))
            self._y = np.full((max(self._lengths), lanes), np.nan)
            for lane, segment in enumerate(self):
                self._u[: len(segment.y), :, lane], self._y[: len(segment.y), lane] = segment.u, segment.y

    def __len__(self) -> int:
        """Return the number of segments."""
        return len(self._segments)

    @overload
    def __getitem__(self, place: int) -> Segment: ...

    @overload
    def __getitem__(self, place: slice) -> tuple[Segment, ...]: ...

    def __getitem__(self, place: int | slice) -> Segment | tuple[Segment, ...]:
        """Return one or several segments."""
        return self._segments[place]

    def sum_squared_errors(
        self, theta: NDArray[np.float64], codes: NDArray[np.int64], starts: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """Return the sum of the squared errors of the free run of each segment; None if one diverges.

        Parameters
        ----------
        theta, codes
            As of `StateSpaceFit`.
        starts : ndarray, shape (segments, states)
            States at the first rows.

        Returns
        -------
        ndarray, shape (segments,), or None
            Of measured outputs, without those at a limit that the simulation exceeds.
        """
        if len(self) == 1:
            errors = simulate_errors(theta, codes, self[0], starts[0])
            return None if errors is None else np.array([np.nansum(errors**2)])
        states, total = np.zeros((starts.shape[1], len(self._lengths))), np.empty(len(self._lengths))
        states[:, : len(self)] = starts.T
        limits = self[0].lower, self[0].upper
        signals = self._u, self._y, self._lengths
        is_bounded = sum_squared_errors(theta, codes, *signals, *limits, states, total)
        return total[: len(self)] if is_bounded else None

    def trace(
        self, theta: NDArray[np.float64], codes: NDArray[np.int64], starts: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """Return the states, the units and their slopes of the free runs; None if one diverges.

        Parameters
        ----------
        theta, codes, starts
            As of `sum_squared_errors`.

        Returns
        -------
        ndarray, shape (rows, states and units and units, lanes), or None
            A lane for each segment, and further ones.
        """
        items = starts.shape[1] + 2 * len(codes)
        if len(self) == 1:
            traces = np.empty((len(self[0].y), items, 1))
            is_bounded = trace_states(theta, codes, self[0].u, starts[0], traces) == len(traces)
        else:
            traces = np.empty((len(self._u), items, len(self._lengths)))
            states = np.zeros((starts.shape[1], len(self._lengths)))
            states[:, : len(self)] = starts.T
            is_bounded = trace_lanes(theta, codes, self._u, self._lengths, states, traces)
        return traces if is_bounded else None
