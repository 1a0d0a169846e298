"""Simulation of a system for several sets of values at once."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from islands.expressions.tree import Apply, Constant, Expression, Primitive, Symbol
from islands.simulators.ode.kernel import integrate
from islands.simulators.ode.kernel_arguments import LANES, LaneRestarts, LaneSignals
from islands.simulators.ode.lane_values import LaneInput, LaneValues
from islands.simulators.ode.native_code import find_native_code
from islands.simulators.ode.program import OdeProgram
from islands.simulators.ode.sampled_signal import SampledSignal, chain_signals, stack_signals

_NO_RESTARTS = LaneRestarts(np.empty(0, dtype=np.int64), np.empty((0, 0)))


def simulate_lanes(
    program: OdeProgram, dt: float, lanes: Sequence[LaneInput], every: int = 1
) -> NDArray[np.float64]:
    """Simulate a system, `LANES` at a time.

    Parameters
    ----------
    program : OdeProgram
    dt : float
        Step in seconds, one per sample.
    lanes : sequence of LaneInput
        All have the same force laws.
    every : int
        The outputs have one sample of ``every`` successive ones, the first.

    Returns
    -------
    ndarray, shape (lanes, outputs, samples)
        NaN in all samples of a lane that diverges. A lane does not depend on the others. The array is not
        contiguous: the values of one sample follow one another.
    """
    samples = count_samples(lanes)
    out = np.empty((-(-samples // every), program.instructions.outputs.size, -(-len(lanes) // LANES) * LANES))
    values, indices = LaneValues(program, lanes), np.arange(len(lanes))
    for first in range(0, len(lanes), LANES):
        group = slice(first, first + LANES)
        signals, order = pack_signals(program.signals, dt, lanes[group])
        integrate_group(program, values, indices[group], signals, order, _NO_RESTARTS, dt, first, every, out)
    found: NDArray[np.float64] = out.transpose(2, 1, 0)[: len(lanes)]
    return found


def integrate_group(
    program: OdeProgram,
    values: LaneValues,
    group: NDArray[np.int64],
    signals: LaneSignals,
    order: NDArray[np.int64],
    restarts: LaneRestarts,
    dt: float,
    first: int,
    every: int,
    out: NDArray[np.float64],
) -> None:
    """Simulate up to `LANES` or `MANY_LANES` lanes, as machine code if the program runs often.

    Parameters
    ----------
    values : LaneValues
    group : ndarray of int64, shape (lanes,)
        The lanes of ``values`` to simulate.
    signals, order
        As of `pack_signals`; the number of lanes of the kernel is that of the places.
    restarts : LaneRestarts
    first : int
        Place of the first lane in ``out``.
    out : ndarray, shape (samples, outputs, lanes)
        Receives the outputs.
    """
    width = signals.places.shape[2]
    given = values.take(np.append(group, group[:1].repeat(width - group.size)))
    if native := find_native_code(program, signals, order, given.limits, restarts):
        native.integrate(given, signals, dt, restarts, group.size, first, every, out)
    elif width == LANES:
        instructions = program.instructions._replace(signals=program.instructions.signals[order])
        arguments = given.arena, signals, dt, given.limits, restarts, given.laws
        integrate(instructions, *arguments, group.size, first, every, out)
    else:
        for begin in range(0, group.size, LANES):
            part = slice(begin, begin + LANES)
            own = signals._replace(places=np.ascontiguousarray(signals.places[:, :, part]))
            states = restarts.states.reshape(len(restarts.states), -1, width)[..., part]
            fewer = restarts._replace(states=states.reshape(len(states), -1))
            integrate_group(program, values, group[part], own, order, fewer, dt, first + begin, every, out)


def pack_signals(
    expressions: Sequence[Expression], dt: float, lanes: Sequence[LaneInput]
) -> tuple[LaneSignals, NDArray[np.int64]]:
    """Return the signals of up to `LANES` lanes, and the order of shared and own ones among all signals."""
    samples = count_samples(lanes)
    found, indices = list_signals(expressions, dt, lanes)
    is_shared = (indices == indices[0]).all(axis=0)
    own, places = np.unique(indices[:, ~is_shared], return_inverse=True)
    # The last lanes repeat the last one that is given.
    places = places.reshape(len(lanes), -1)[np.minimum(np.arange(LANES), len(lanes) - 1)]
    signals = LaneSignals(
        stack_signals([found[index] for index in indices[0, is_shared]], samples),
        chain_signals([found[index] for index in own], samples),
        np.ascontiguousarray(3 * samples * places.T[None]),
    )
    return signals, np.argsort(~is_shared, kind="stable")


def count_samples(lanes: Sequence[LaneInput]) -> int:
    """Return the number of samples of lanes."""
    return len(next(iter(lanes[0].signals.values())).moments)


def list_signals(
    expressions: Sequence[Expression], dt: float, lanes: Sequence[LaneInput]
) -> tuple[list[SampledSignal], NDArray[np.int64]]:
    """Return the signals of all lanes once each, and their indices, shape (lanes, expressions)."""
    made: dict[tuple[object, ...], SampledSignal] = {}
    rows = [[make_signal(expression, dt, lane, made) for expression in expressions] for lane in lanes]
    signals = {id(signal): signal for row in rows for signal in row}
    places = {key: index for index, key in enumerate(signals)}
    indices = [[places[id(signal)] for signal in row] for row in rows]
    return list(signals.values()), np.array(indices, dtype=np.int64).reshape(len(lanes), -1)


def make_signal(
    expression: Expression, dt: float, lane: LaneInput, made: dict[tuple[object, ...], SampledSignal]
) -> SampledSignal:
    """Return a signal of a lane; ``made`` keeps those that are computed, for lanes with the same ones."""
    match expression:
        case Symbol(name):
            return lane.signals[name]
        case Apply(Primitive("rate"), (Symbol(name),)):
            signal = lane.signals[name]
            key: tuple[object, ...] = "rate", id(signal)
            if key not in made:
                made[key] = signal.differentiate(dt)
        case Apply(Primitive("delay"), (Symbol(name), Symbol() | Constant() as delay)):
            signal = lane.signals[name]
            seconds = delay.value if isinstance(delay, Constant) else lane.parameters[delay.name]
            key = "delay", id(signal), float(seconds)
            if key not in made:
                made[key] = signal.delay(max(float(seconds), 0.0), dt)
        case _:
            raise AssertionError(expression)
    return made[key]
