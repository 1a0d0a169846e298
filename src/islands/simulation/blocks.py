"""Simulation of a block on signals, for several sets of parameters and several intervals at once."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from islands.errors import SettingsError
from islands.expressions.evaluation import value
from islands.expressions.primitives import ADD, MUL
from islands.expressions.tree import Apply, Expression, Lagged, Symbol, remove_shifts, replace
from islands.kernels.interpreter import Program
from islands.kernels.simulate_block import LANES, MANY_LANES, simulate_block
from islands.models.block import Block
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel
from islands.models.latent import LatentModel
from islands.program.term_pool import link
from islands.records.coupled import AnyRecord, CoupledRecord
from islands.records.dataset import Dataset
from islands.records.signal_map import map_signals
from islands.simulation.initial_states import estimate_coupled_states, estimate_initial_states
from islands.simulation.layout import check_warm_up, find_intervals


class LinkedBlock:
    """A block with its program, which is built once for many simulations."""

    def __init__(self, block: Block) -> None:
        self._program, self._weights = _link(block)
        self._ends = np.cumsum([len(equation) for equation in block.equations], dtype=np.int64)

    def simulate(self, signals: NDArray[np.float64], sets: NDArray[np.float64], warm_up: int) -> None:
        """Compute all rows after the warm-up in place.

        Parameters
        ----------
        signals : ndarray, shape (channels, rows, lanes)
            In C order, with `LANES` or `MANY_LANES`; a row does not depend on later ones, nor a lane on
            others.
        sets : ndarray, shape (parameters, lanes)
        warm_up : int
            Number of rows before the first computed one, at least the largest lag.
        """
        ones = np.ones(signals.shape[2])
        weights = np.array([ones if place is None else sets[place] for place in self._weights])
        constants = np.empty((self._program.constants.size, len(ones)))
        for row, number, fixed in zip(
            constants, self._program.parameters, self._program.constants, strict=True
        ):
            row[:] = sets[number - 1] if number else fixed
        flat = signals.reshape(len(signals), -1)
        simulate_block(self._program, weights, constants, self._ends, warm_up, flat)


class BlockSimulator:
    """A block with its program and the intervals of a record, which are built once for many simulations.

    Parameters
    ----------
    block : Block
        Its parameters are passed to the calls.
    outputs : ndarray, shape (outputs, samples)
        Measured outputs, which are read during the warm-up of every interval.
    inputs : ndarray, shape (inputs, samples)
    start, length : ndarray of int64, shape (intervals,)
        First predicted sample and number of samples of every interval.
    warm_up : int
        Number of samples before the first prediction that may be read, at least the largest lag.

    Attributes
    ----------
    states : ndarray, shape (intervals, states), or None
        States at the last samples before the intervals, in place of the starts of the block.
    """

    def __init__(
        self,
        block: Block,
        outputs: NDArray[np.float64],
        inputs: NDArray[np.float64],
        start: NDArray[np.int64],
        length: NDArray[np.int64],
        warm_up: int,
    ) -> None:
        self._block, self._warm_up = block, warm_up
        self.states: NDArray[np.float64] | None = None
        self._linked = LinkedBlock(block)
        self._outputs, self._inputs = outputs, inputs
        self._start, self._length = start, length
        self._order = np.argsort(-length, kind="stable")

    def __call__(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Simulate every interval with every set of parameters.

        Parameters
        ----------
        parameters : ndarray, shape (sets, parameters)

        Returns
        -------
        ndarray, shape (sets, computed signals, samples)
            NaN outside of the intervals. A set and an interval do not depend on the others.
        """
        return self._simulate(parameters, self._block.computed)

    def simulate_outputs(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Simulate as a call, and return the outputs only, shape (sets, outputs, samples)."""
        return self._simulate(parameters, self._block.outputs)

    def _simulate(self, parameters: NDArray[np.float64], computed: int) -> NDArray[np.float64]:
        """Return the first computed signals; those of many states would need much memory."""
        found: NDArray[np.float64] = np.full((len(parameters), computed, self._outputs.shape[1]), np.nan)
        runs = [(number, int(interval)) for interval in self._order for number in range(len(parameters))]
        for lanes in _make_groups(runs):
            signals = self._run(parameters, lanes)
            for lane, (number, interval) in enumerate(lanes):
                first, length = self._start[interval], self._length[interval]
                found[number, :, first : first + length] = signals[
                    :computed, self._warm_up : self._warm_up + length, lane
                ]
        return found

    @property
    def start(self) -> NDArray[np.int64]:
        """First predicted sample of every interval."""
        return self._start

    @property
    def intervals(self) -> NDArray[np.int64]:
        """Number of samples of every interval, in the order of time."""
        return self._length[np.argsort(self._start)]

    @property
    def predicted(self) -> NDArray[np.bool_]:
        """Whether each sample is in an interval, shape (samples,)."""
        found = np.zeros(self._outputs.shape[1], bool)
        for start, length in zip(self._start, self._length, strict=True):
            found[start : start + length] = True
        return found

    def remove_diverged(self, y: NDArray[np.float64], bounds: Sequence[float]) -> tuple[int, int] | None:
        """Set all outputs to NaN from the divergence of one to the end of its interval.

        Parameters
        ----------
        y : ndarray, shape (outputs, samples)
        bounds : sequence of float
            A prediction of an output with a larger absolute value has diverged.

        Returns
        -------
        (int, int) or None
            First diverged sample, and its output; None if there is none.
        """
        limits = np.array(bounds)[:, None]
        failures = []
        for start, length in zip(self._start, self._length, strict=True):
            run = y[:, start : start + length]
            outside = ~(np.abs(run) <= limits)
            if outside.any():
                first = int(np.argmax(outside.any(axis=0)))
                failures.append((int(start) + first, int(np.argmax(outside[:, first]))))
                run[:, first:] = np.nan
        return min(failures, default=None)

    def _run(self, parameters: NDArray[np.float64], lanes: Sequence[tuple[int, int]]) -> NDArray[np.float64]:
        """Simulate as many runs as a row of the kernel has lanes, shape (channels, rows, lanes)."""
        width = LANES if len(lanes) <= LANES else MANY_LANES
        # Lanes that are left over repeat the runs, and are ignored.
        repeated = [lanes[lane % len(lanes)] for lane in range(width)]
        sets = parameters[[number for number, _ in repeated]].T
        intervals = np.array([interval for _, interval in repeated])
        rows = self._warm_up + int(self._length[intervals].max())
        samples = np.minimum(
            (self._start[intervals] - self._warm_up) + np.arange(rows)[:, None], self._outputs.shape[1] - 1
        )
        states = np.zeros((len(self._block.starts), rows, width))
        # The order of the axes in memory is otherwise that of the record.
        signals = np.ascontiguousarray(
            np.concatenate([self._outputs[:, samples], states, self._inputs[:, samples]])
        )
        self._start_states(signals, sets, intervals)
        self._linked.simulate(signals, sets, self._warm_up)
        return signals

    def _start_states(
        self, signals: NDArray[np.float64], sets: NDArray[np.float64], intervals: NDArray[np.int64]
    ) -> None:
        """Write the states of the warm-up."""
        if self.states is not None:
            signals[self._block.outputs : self._block.computed, self._warm_up - 1] = self.states[intervals].T
            return
        named = dict(zip(self._block.parameters, sets, strict=True))
        first = signals[:, : self._warm_up]
        for place, start in enumerate(self._block.starts, start=self._block.outputs):
            first[place] = value(start, lambda channel, _lag: first[channel], named)


def make_simulator(model: AnyModel, record: AnyRecord, interval: int | None, warm_up: int) -> BlockSimulator:
    """Return the simulator of the block of a model on the intervals of a record.

    The initial states of latent models are those that their parameters estimate from the warm-up.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    record, interval, warm_up
        As for `make_block_simulator`.

    Raises
    ------
    RecordError, SettingsError
        As in `make_block_simulator`.
    """
    made = make_block_simulator(model.block(), record, interval, warm_up)
    if isinstance(model, LatentModel):
        assert isinstance(record, Dataset), "the record matches the model"
        made.states = estimate_initial_states(model, record, made.start, warm_up)
    elif isinstance(model, CoupledLatentModel):
        assert isinstance(record, CoupledRecord), "the record matches the model"
        made.states = estimate_coupled_states(model, record.records, made.start, warm_up)
    return made


def make_block_simulator(
    block: Block, record: AnyRecord, interval: int | None, warm_up: int
) -> BlockSimulator:
    """Return the simulator of a block on the intervals of a record.

    Parameters
    ----------
    block : Block
    record : Dataset or CoupledRecord
        Signals of the block.
    interval : int or None
        Length of a shooting interval in samples, 1 for one-step-ahead prediction; None is the free run over
        each whole segment. A block whose states are not determined by measured outputs cannot restart: its
        prediction from the past is the free run for any interval (Ljung 1999, section 4.2: the predictor of
        an output error model).
    warm_up : int
        Number of samples before the first prediction.

    Raises
    ------
    RecordError
        No segment is longer than the warm-up, or the output is missing in a warm-up.
    SettingsError
        The interval is less than 1.
    """
    if interval is not None and interval < 1:
        raise SettingsError(f"a shooting interval has at least 1 sample, got {interval}")
    start, length = find_intervals(record, warm_up, interval if block.restarts_from_outputs else None)
    outputs = np.atleast_2d(record.y.T)
    # The states of a state space are estimated from the known outputs, and rest without any.
    for y in () if block.is_state_space else outputs:
        check_warm_up(y, start, warm_up)
    return BlockSimulator(block, outputs, record.u.T, start, length, warm_up)


def _make_groups(runs: Sequence[tuple[int, int]]) -> Iterator[Sequence[tuple[int, int]]]:
    """Yield runs that are simulated together."""
    lanes = LANES if len(runs) <= LANES else MANY_LANES
    for begin in range(0, len(runs), lanes):
        yield runs[begin : begin + lanes]


# A result simulates one model many times, and a block of many states takes seconds.
@lru_cache(maxsize=16)
def _link(block: Block) -> tuple[Program, list[int | None]]:
    """Return the program of all terms, and the place of the parameter that multiplies each term."""
    names = list(block.parameters)
    places = {name: place for place, name in enumerate(names)}
    terms = [term for equation in block.equations for term in equation]
    read_past = _PastReader(block)
    program = link([read_past(term.expression) for term in terms], names)
    return program, [places[term.weight] if term.weight else None for term in terms]


class _PastReader:
    """Replaces sample k of the states by their equations: the kernel evaluates all equations at once.

    Equations share units, and every output reads all states: each is replaced once.
    """

    def __init__(self, block: Block) -> None:
        self._block = block
        self._read: dict[Expression, Expression] = {}
        self._sums: dict[int, Expression] = {}

    def __call__(self, expression: Expression) -> Expression:
        """Return an expression of past samples, and of the inputs."""
        found = self._read.get(expression)
        if found is None:
            found = self._read[expression] = replace(remove_shifts(expression), self._find)
        return found

    def _find(self, part: Expression) -> Expression | None:
        if not (isinstance(part, Lagged) and part.lag == 0):
            return None
        found = self._sums.get(part.channel)
        if found is None:
            found = self._sums[part.channel] = self._sum_terms(part.channel)
        return found

    def _sum_terms(self, channel: int) -> Expression:
        """Return the right side of the equation of a signal."""
        terms = [
            Apply(MUL, (Symbol(term.weight), term.expression)) if term.weight else term.expression
            for term in self._block.equations[channel]
        ]
        read = [self(term) for term in terms]
        return read[0] if len(read) == 1 else Apply(ADD, tuple(read))


@dataclass(frozen=True, slots=True, eq=False)
class UnitRun:
    """Free run of a latent model.

    Attributes
    ----------
    arguments : ndarray, shape (units, samples)
        Arguments of the units.
    output : ndarray, shape (samples,)
        Output, less the offset of the model. Both have the samples from the warm-up of a segment until the
        output leaves the range of the record by more than this range, as in a divergence.
    """

    arguments: NDArray[np.float64]
    output: NDArray[np.float64]


def simulate_units(
    model: LatentModel, record: Dataset, warm_up: int, parameters: NDArray[np.float64]
) -> list[UnitRun]:
    """Return the free run with every set of parameters.

    Parameters
    ----------
    model : LatentModel
        Its parameters give the initial states of every segment, from which all sets start.
    record : Dataset
    warm_up : int
        Number of samples before the first prediction.
    parameters : ndarray, shape (sets, parameters)

    Raises
    ------
    RecordError, SettingsError
        As in `free_run`.
    """
    signals, _ = map_signals(model, record)
    simulate = make_simulator(model, signals, None, warm_up)
    known = signals.y[~np.isnan(signals.y)]
    bound = float(np.abs(known).max() + np.ptp(known)) if np.ptp(known) else np.inf
    # An input that is read early is rolled within the warm-up of its segment.
    leads = model.leads[1 + model.order :]
    u = np.array([np.roll(signals.u[:, place], lead) for place, lead in enumerate(leads)])
    runs = []
    for values, found in zip(parameters, simulate(parameters), strict=True):
        simulate.remove_diverged(found[:1], [bound])
        kept = np.isfinite(found[: 1 + model.order]).all(axis=0)
        of = model.with_parameters(values.tolist()).matrices
        states, inputs = found[1 : 1 + model.order, kept], u[:, kept]
        runs.append(UnitRun(of["W"] @ states + of["V"] @ inputs + of["s"][:, None], found[0, kept]))
    return runs
