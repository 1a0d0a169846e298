"""Blocks of a record on which state spaces are estimated, and the error on their held-out rows.

The blocks are spread over the record. The rows after each are held out, because the least error on the
estimation data prefers models that are too large. A simulation takes much less time than an estimation, so
that all other rows of a long record are held out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray

from islands.estimation.constraints.state_space import (
    NO_CONDITIONS,
    StateSpaceConditions,
    find_conditions,
)
from islands.estimation.state_space_fit import StateSpaceFit
from islands.kernels.state_space import simulate_states
from islands.models.latent import StateSpaceLayout
from islands.records.dataset import Dataset
from islands.records.flat_extremes import SensorLimits, find_limits
from islands.records.input_lead import advance_all_inputs
from islands.simulation.initial_states import Segment, estimate_states
from islands.simulation.segment_lanes import SegmentLanes

#: Blocks of a record, samples of a block at least, and the part of each that is held out at least. Slow
#: states are not visible in short blocks.
_BLOCKS, _SMALLEST_BLOCK, _HELD_OUT = 5, 500, 0.2

#: Rows of each block for the estimation in a search, and for the final one, at most.
_USED_ROWS, _FINAL_ROWS = 600, 4_000

#: Rows of all blocks for the estimation in a search, at most: of many recordings, some are left out.
_ALL_USED_ROWS = 6_000

#: Samples from which the initial states of a free run are estimated, at most.
LARGEST_MEMORY = 100

#: Simulations of held-out rows from disturbed states, the standard deviation of the disturbance relative to
#: that of the states, and the rows before and after the first held-out one, at most.
_DISTURBED, _DISTURBANCE, _FORGETTING, _DISTURBED_ROWS = 2, 1.5, 1_500, 500

#: Seed of the disturbances: all models are compared with the same ones.
_SEED = 5


@dataclass(frozen=True, slots=True, eq=False)
class SignalScales:
    """Means and standard deviations of the inputs and the output of a record, 1 of a constant.

    Attributes
    ----------
    mean, deviation : ndarray, shape (inputs,)
    level, height : float
        Mean and standard deviation of the output.
    """

    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]
    level: float
    height: float

    @classmethod
    def measure(cls, record: Dataset, *, offsets: bool = True, level: bool = True) -> Self:
        """Measure those of a record.

        Parameters
        ----------
        record : Dataset
        offsets, level : bool
            Whether the model has offsets of its states and units, and a level of its output. Without them,
            the mean of the inputs, or of the output, is zero here, and the scale a root mean square.
        """
        y = record.y[~np.isnan(record.y)]
        return cls(
            record.u.mean(axis=0) if offsets else np.zeros(record.inputs),
            _deviation(record.u) if offsets else _root_mean_square(record.u),
            float(np.nanmean(record.y)) if level else 0.0,
            float(_deviation(y) if level else _root_mean_square(y)),
        )

    def scale_inputs(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return inputs of the mean 0 and the standard deviation 1."""
        return (u - self.mean) / self.deviation

    def scale_outputs(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return outputs of the mean 0 and the standard deviation 1."""
        return (y - self.level) / self.height

    def scale_limits(self, limits: SensorLimits) -> tuple[float, float]:
        """Return the limits of scaled outputs, infinite without one."""
        lower, upper = self.scale_outputs(np.array(limits.range)).tolist()
        return lower, upper

    def scale_conditions(self, conditions: StateSpaceConditions) -> StateSpaceConditions:
        """Return the conditions for scaled signals."""
        return conditions.scale(self.mean, self.deviation, self.level, self.height)

    def use_record_units(self, layout: StateSpaceLayout, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the parameters for signals of the record, of those for scaled ones."""
        found = theta.copy()
        blocks = layout.split(found)
        for block in (blocks["B"], blocks["W"][:, layout.order :], blocks["D"]):
            block[...] = block / self.deviation
        blocks["o"] -= blocks["B"] @ self.mean
        blocks["s"] -= blocks["W"][:, layout.order :] @ self.mean
        for name in ("C", "D", "F", "level"):
            blocks[name] *= self.height
        blocks["level"] += self.level - blocks["D"] @ self.mean
        return found

    def use_scaled_units(self, layout: StateSpaceLayout, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the parameters for scaled signals, of those for signals of the record."""
        found = theta.copy()
        blocks = layout.split(found)
        blocks["level"] -= self.level - blocks["D"] @ self.mean
        for name in ("C", "D", "F", "level"):
            blocks[name] /= self.height
        blocks["o"] += blocks["B"] @ self.mean
        blocks["s"] += blocks["W"][:, layout.order :] @ self.mean
        for block in (blocks["B"], blocks["W"][:, layout.order :], blocks["D"]):
            block[...] = block * self.deviation
        return found


@dataclass(frozen=True, slots=True, eq=False)
class LatentData:
    """A record and its blocks, all signals of which have the standard deviation 1.

    Attributes
    ----------
    record : Dataset
        In the units of the signals, with all inputs one sample early.
    scaled : Dataset
        The same record with the standard deviation 1 of all signals.
    used : SegmentLanes
        Blocks for the estimation.
    final : SegmentLanes
        The same blocks with further rows, for the final estimation.
    held_out : HeldOutRows
        The rows between a block and the next one, for the comparison of models.
    scales : SignalScales
        Of the record.
    limits : SensorLimits
        Of the output of the record.
    stated : StateSpaceConditions
        Conditions on the parameters, in the units of the signals.
    """

    record: Dataset
    scaled: Dataset
    used: SegmentLanes
    final: SegmentLanes
    held_out: "HeldOutRows"
    scales: SignalScales
    limits: SensorLimits
    stated: StateSpaceConditions = NO_CONDITIONS

    @property
    def conditions(self) -> StateSpaceConditions:
        """Conditions on the parameters, for scaled signals."""
        return self.scales.scale_conditions(self.stated)

    @property
    def operating_inputs(self) -> tuple[float, ...]:
        """Inputs about which models are linearised: those of a stated gain, or the means."""
        stated = (each.inputs for each in self.stated.statics if each.channel)
        return next(stated, tuple(self.scales.mean.tolist()))

    def delay(self, delays: tuple[int, ...]) -> "LatentData":
        """Return the data whose inputs of a row are those of some samples before; empty for none.

        Before a recording, an input has the first value that is read.
        """
        if not any(delays):
            return self
        used, final, held_out = _cut(self.scaled, self.scales.scale_limits(self.limits), delays)
        return replace(self, used=used, final=final, held_out=held_out)

    def without_statics(self) -> "LatentData":
        """Return the same data without the static conditions, which a search does not impose."""
        return replace(self, stated=replace(self.stated, statics=()))


# The islands of a process share the blocks of a record.
@lru_cache(maxsize=2)
def make_latent_data(record: Dataset, constraints: str = "none") -> LatentData:
    """Scale a record and cut blocks out of it.

    All inputs are read one sample early, so that the first row of a segment lacks them.

    Parameters
    ----------
    record : Dataset
    constraints : str
        Statements about the models; see `find_conditions`.
    """
    record = advance_all_inputs(record)
    stated = find_conditions(constraints, record.inputs)
    scales = SignalScales.measure(record, offsets=not stated.is_odd, level=not stated.is_odd)
    u, y = scales.scale_inputs(record.u), scales.scale_outputs(record.y)
    scaled = replace(record, u=u, y=y)
    limits = find_limits(record.y, record.bounds)
    limits = limits.mirror(record.y) if stated.is_odd else limits
    blocks = _cut(scaled, scales.scale_limits(limits), (0,) * record.inputs)
    return LatentData(record, scaled, *blocks, scales, limits, stated)


# The systems of a search have few different dead times.
@lru_cache(maxsize=4)
def _cut(
    record: Dataset, limits: tuple[float, float], delays: tuple[int, ...]
) -> tuple[SegmentLanes, SegmentLanes, "HeldOutRows"]:
    """Return the used, the final and the held-out rows of a scaled record with delayed inputs."""
    late = _delay_inputs(record, delays)
    used: list[Segment] = []
    final: list[Segment] = []
    whole: list[Segment] = []
    for begin, end in _spread(list(_cut_blocks(record))):
        cut = end - round(_HELD_OUT * (end - begin))
        used.append(_take(late, begin, min(cut, begin + _USED_ROWS), limits))
        final.append(_take(late, begin, min(end, begin + _FINAL_ROWS), limits))
        whole.append(_take(late, begin, end, limits))
    return SegmentLanes(used), SegmentLanes(final), _hold_out(whole, used)


def _delay_inputs(record: Dataset, delays: Sequence[int]) -> Dataset:
    """Return the record with the inputs of some samples before."""
    if not any(delays):
        return record
    u = record.u.copy()
    for begin, end in record.bounds:
        for place, delay in enumerate(delays):
            u[begin:end, place] = record.u[np.maximum(np.arange(begin, end) - delay, begin), place]
    return replace(record, u=u)


def _deviation(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviation of each column, 1 for a constant."""
    found = values.std(axis=0)
    return np.where(found > 0.0, found, 1.0)


def _root_mean_square(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the root mean square of each column, 1 for a column of zeros."""
    found = np.sqrt(np.mean(values**2, axis=0))
    return np.where(found > 0.0, found, 1.0)


def _cut_blocks(record: Dataset) -> Iterator[tuple[int, int]]:
    """Yield the first and the last row of each block; blocks do not cross segments."""
    share = max(_SMALLEST_BLOCK, record.samples // _BLOCKS)
    for begin, end in record.bounds:
        count = max(1, round((end - begin) / share))
        yield from pairwise(np.linspace(begin, end, count + 1).astype(int).tolist())


def _spread(blocks: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the blocks, or some of them at equal distances if all would have too many rows."""
    longest = max(min(_USED_ROWS, end - begin) for begin, end in blocks)
    most = max(_BLOCKS, _ALL_USED_ROWS // longest)
    if len(blocks) <= most:
        return list(blocks)
    return [blocks[at] for at in np.linspace(0, len(blocks) - 1, most).round().astype(int)]


def _take(record: Dataset, begin: int, end: int, limits: tuple[float, float]) -> Segment:
    """Return rows with the inputs at the same samples."""
    first = begin + 1 if begin in {bounds[0] for bounds in record.bounds} else begin
    u, y = np.ascontiguousarray(record.u[first - 1 : end - 1]), record.y[first:end].copy()
    return Segment(u, y, *limits)


def _count_memory(segment: Segment) -> int:
    """Return the number of rows from which initial states are estimated."""
    return min(len(segment.y) // 3, LARGEST_MEMORY)


def estimate_start(
    theta: NDArray[np.float64], codes: NDArray[np.int64], segment: Segment, order: int
) -> NDArray[np.float64]:
    """Estimate the states at the first row of a block."""
    return estimate_states(theta, codes, segment.take(0, _count_memory(segment)), np.zeros(order))


def measure_deviations(
    theta: NDArray[np.float64],
    codes: NDArray[np.int64],
    u: NDArray[np.float64],
    start: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """Return the standard deviation of each state for an input, 1 of a state that does not move.

    Parameters
    ----------
    theta : ndarray, shape (parameters,)
        Parameters in the order of the kernel.
    codes : ndarray of int64, shape (units,)
    u : ndarray, shape (rows, inputs)
    start : ndarray, shape (states,)
        States at the first row.

    Returns
    -------
    ndarray, shape (states,), or None
        None after a divergence.
    """
    states = np.empty((len(u), len(start)))
    if simulate_states(theta, codes, u, start, states) < len(u):
        return None
    found = states.std(axis=0)
    return np.where(found > 0.0, found, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutRows:
    """Free runs of the blocks whose errors on the held-out rows compare models.

    Attributes
    ----------
    late : tuple of Segment
        Held-out rows of each block.
    runs : SegmentLanes
        All rows of each block, then its held-out rows. Outputs that are not scored are missing.
    disturbed : SegmentLanes
        Rows about the first held-out one of each block, once for each disturbance.
    """

    late: tuple[Segment, ...]
    runs: SegmentLanes
    disturbed: SegmentLanes


def _hold_out(whole: Sequence[Segment], used: Sequence[Segment]) -> HeldOutRows:
    """Make the free runs of blocks of which the first rows are used."""
    cuts = [len(each.y) for each in used]
    late = [each.take(cut, None) for each, cut in zip(whole, cuts, strict=True)]
    disturbed = [
        _score(each, cut).take(max(0, cut - _FORGETTING), cut + _DISTURBED_ROWS)
        for each, cut in zip(whole, cuts, strict=True)
    ]
    runs = [*map(_score, whole, cuts), *map(_score, late, map(_count_memory, late))]
    return HeldOutRows(tuple(late), SegmentLanes(runs), SegmentLanes(_DISTURBED * disturbed))


def _score(segment: Segment, first: int) -> Segment:
    """Return a segment without the outputs before a row."""
    y = segment.y.copy()
    y[:first] = np.nan
    return replace(segment, y=y)


def measure_held_out(fit: StateSpaceFit, data: LatentData) -> float:
    """Return the mean squared error of the held-out rows of all blocks; infinite after a divergence.

    It is the largest one of several free runs. That of the block goes on, since a start at the held-out rows
    would hide the error of slow states. Another one starts there from estimated states, as a simulation of
    the model does. The others start in the block from disturbed states, which a model with a second
    equilibrium does not forget. The error is in the squared unit of the output.

    No run has inputs that the data do not: a system may diverge at larger ones as its model does. The physics
    checks of the result choose among models that the data do not distinguish; see `recommend`.
    """
    scales = measure_deviations(fit.theta, fit.codes, data.used[0].u, fit.states[0])
    if scales is None:
        return np.inf
    order, rows = fit.states.shape[1], data.held_out
    starts = [estimate_start(fit.theta, fit.codes, each, order) for each in rows.late]
    normal = np.random.default_rng(_SEED).standard_normal((len(starts), _DISTURBED, order))
    disturbed = _DISTURBANCE * scales * normal.transpose(1, 0, 2).reshape(_DISTURBED * len(starts), order)
    errors = []
    for lanes, states in (
        (rows.disturbed, disturbed),
        (rows.runs, np.vstack([fit.states, starts])),
    ):
        squares = lanes.sum_squared_errors(fit.theta, fit.codes, states)
        if squares is None:
            return np.inf
        sums, counts = (each.reshape(-1, len(starts)).sum(axis=1) for each in (squares, lanes.counts))
        errors += (sums / np.maximum(counts, 1)).tolist()
    return float(max(errors)) * data.scales.height**2
