"""Simulation of a system for several sets of values at once, and the signals that it reads."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.kernels.simd import padded_size
from islands.systems.mechanics import WIDTH, Elements
from islands.systems.ode.equation_parser import TIME
from islands.systems.ode.kernel_arguments import LANES, LaneForces, LaneLimits, LaneRestarts, LaneSignals
from islands.systems.ode.native_code import find_native_code
from islands.systems.ode.ode_expression import Number, OdeExpression, Operation, Symbol
from islands.systems.ode.ode_kernel import integrate
from islands.systems.ode.ode_program import OdeProgram

Signal = NDArray[np.float64]

_NO_RESTARTS = LaneRestarts(np.empty(0, dtype=np.int64), np.empty((0, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class SampledSignal:
    """A signal at the start, in the middle and at the end of each step, each of shape (samples,).

    The end of a step is the start of the next one, unless the signal jumps there.
    """

    start: Signal
    middle: Signal
    end: Signal

    @property
    def is_held(self) -> bool:
        """Whether the signal is constant within each step."""
        return np.array_equal(self.start, self.middle) and np.array_equal(self.start, self.end)

    def differentiate(self, dt: float) -> "SampledSignal":
        """Return the rate: the derivative of the parabola through the values of each step.

        A held signal would have impulses; its rate is that of a ramp to the next value within the step.
        """
        if self.is_held:
            rate = np.append(np.diff(self.start), 0.0) / dt
            return SampledSignal(rate, rate, rate)
        first, second = self.middle - self.start, self.end - self.middle
        return SampledSignal((3.0 * first - second) / dt, (first + second) / dt, (3.0 * second - first) / dt)

    def refine(self, parts: int) -> "SampledSignal":
        """Return the signal with each step divided, by the parabola through the values of the step."""
        if parts == 1:
            return self
        first, second = self.middle - self.start, self.end - self.middle
        linear, quadratic = (3.0 * first - second)[:, None], 2.0 * (second - first)[:, None]
        places = (np.arange(parts) + np.array([[0.0], [0.5], [1.0]])) / parts
        return SampledSignal(
            *((self.start[:, None] + f * (linear + f * quadratic)).reshape(-1) for f in places)
        )

    def delay(self, seconds: float, dt: float) -> "SampledSignal":
        """Return the signal delayed by linear interpolation; before the first sample it is constant.

        A held signal is averaged over the step, so that the result is continuous in the delay.
        """
        steps = np.arange(self.start.size, dtype=np.float64) - seconds / dt
        if self.is_held:
            held = np.interp(steps, np.arange(self.start.size), self.start)
            return SampledSignal(held, held, held)
        fine = np.append(np.column_stack([self.start, self.middle]).reshape(-1), self.end[-1])
        places = 0.5 * np.arange(fine.size)
        return SampledSignal(*(np.interp(steps + part, places, fine) for part in (0.0, 0.5, 1.0)))


def interpolate_linearly(signal: Signal) -> SampledSignal:
    """Return a signal that is linear between its samples, and constant after the last one."""
    end = np.append(signal[1:], signal[-1])
    return SampledSignal(signal, (signal + end) / 2, end)


@dataclass(frozen=True, slots=True, eq=False)
class LaneInput:
    """Values and signals of one simulation.

    Attributes
    ----------
    parameters, initial_states : mapping
        Values of the parameters and the states at the first sample by name.
    signals : mapping
        Input, channels and time by name. Lanes share a signal if it is the same object.
    elements : Elements or None
        Force laws with their values; None for none. Their signs are not used: forces resist.
    limits : mapping
        Lower and upper limits of states by name; other states have none.
    spills : mapping
        For a state with an upper limit, the state that receives a part of what the limit cuts off, and that
        part. The receivers are the same in all lanes.
    """

    parameters: Mapping[str, float]
    initial_states: Mapping[str, float]
    signals: Mapping[str, SampledSignal]
    elements: Elements | None = None
    limits: Mapping[str, tuple[float, float]] | None = None
    spills: Mapping[str, tuple[str, float]] | None = None


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
    samples = len(next(iter(lanes[0].signals.values())).start)
    out = np.empty((-(-samples // every), program.instructions.outputs.size, -(-len(lanes) // LANES) * LANES))
    for first in range(0, len(lanes), LANES):
        group = lanes[first : first + LANES]
        signals, order = pack_signals(program.signals, dt, group)
        integrate_group(program, group, signals, order, _NO_RESTARTS, dt, first, every, out)
    found: NDArray[np.float64] = out.transpose(2, 1, 0)[: len(lanes)]
    return found


def integrate_group(
    program: OdeProgram,
    group: Sequence[LaneInput],
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
    signals, order
        As of `pack_signals`; the number of lanes is that of the places.
    restarts : LaneRestarts
    first : int
        Place of the first lane in ``out``.
    out : ndarray, shape (samples, outputs, lanes)
        Receives the outputs.
    """
    instructions = program.instructions._replace(signals=program.instructions.signals[order])
    width = signals.places.shape[2]
    full = [*group, *[group[0]] * (width - len(group))]
    limits = pack_limits(program.states, full)
    if native := find_native_code(instructions, signals, limits, restarts):
        arena = pack_arena(program, full)
        native.integrate(arena, signals, dt, limits, restarts, len(group), first, every, out)
    elif width == LANES:
        arena, laws = pack_arena(program, full), pack_elements(full)
        integrate(instructions, arena, signals, dt, limits, restarts, laws, len(group), first, every, out)
    else:
        for begin in range(0, len(group), LANES):
            part = slice(begin, begin + LANES)
            own = signals._replace(places=np.ascontiguousarray(signals.places[:, :, part]))
            states = restarts.states.reshape(len(restarts.states), -1, width)[..., part]
            given = restarts._replace(states=states.reshape(len(states), -1))
            integrate_group(program, group[part], own, order, given, dt, first + begin, every, out)


def pack_arena(program: OdeProgram, lanes: Sequence[LaneInput]) -> NDArray[np.float64]:
    """Return the rows of a program with its constants, and the parameters and states of all lanes."""
    arena: NDArray[np.float64] = padded_size(len(lanes) * program.instructions.rows)
    rows = arena.reshape(-1, len(lanes))
    count, states = len(program.constants), program.instructions.states
    rows[:count] = program.constants[:, None]
    for lane, each in enumerate(lanes):
        rows[count : count + len(program.parameters), lane] = [
            each.parameters[name] for name in program.parameters
        ]
        rows[states : states + len(program.states), lane] = [
            each.initial_states[name] for name in program.states
        ]
        if each.elements is not None:
            first = states + len(program.states)
            rows[first : first + each.elements.forces.size, lane] = each.elements.initial_states
    return arena


def pack_signals(
    expressions: Sequence[OdeExpression], dt: float, lanes: Sequence[LaneInput]
) -> tuple[LaneSignals, NDArray[np.int64]]:
    """Return the signals of up to `LANES` lanes, and the order of shared and own ones among all signals."""
    samples = len(next(iter(lanes[0].signals.values())).start)
    found, indices = list_signals(expressions, dt, lanes)
    is_shared = (indices == indices[0]).all(axis=0)
    own, places = np.unique(indices[:, ~is_shared], return_inverse=True)
    places = np.pad(places.reshape(len(lanes), -1), ((0, LANES - len(lanes)), (0, 0)), "edge")
    signals = LaneSignals(
        stack_signals([found[index] for index in indices[0, is_shared]], samples),
        stack_signals([found[index] for index in own], samples),
        np.ascontiguousarray(places.T[None]),
    )
    return signals, np.argsort(~is_shared, kind="stable")


def list_signals(
    expressions: Sequence[OdeExpression], dt: float, lanes: Sequence[LaneInput]
) -> tuple[list[SampledSignal], NDArray[np.int64]]:
    """Return the signals of all lanes once each, and their indices, shape (lanes, expressions)."""
    made: dict[tuple[object, ...], SampledSignal] = {}
    found = [[make_signal(expression, dt, lane, made) for expression in expressions] for lane in lanes]
    signals = {id(each): each for row in found for each in row}
    places = {key: index for index, key in enumerate(signals)}
    indices = [[places[id(each)] for each in row] for row in found]
    return list(signals.values()), np.array(indices, dtype=np.int64).reshape(len(lanes), -1)


def stack_signals(signals: Sequence[SampledSignal], samples: int) -> NDArray[np.float64]:
    """Return signals as one array, shape (samples, 3, signals)."""
    stacked = np.empty((samples, 3, len(signals)))
    for index, signal in enumerate(signals):
        stacked[:, 0, index], stacked[:, 1, index], stacked[:, 2, index] = (
            signal.start,
            signal.middle,
            signal.end,
        )
    return stacked


def make_signal(
    expression: OdeExpression, dt: float, lane: LaneInput, made: dict[tuple[object, ...], SampledSignal]
) -> SampledSignal:
    """Return a signal of a lane; ``made`` keeps those that are computed, for lanes with the same ones."""
    match expression:
        case Symbol(name):
            return lane.signals[name]
        case Operation("rate", (Symbol(name),)):
            signal = lane.signals[name]
            key: tuple[object, ...] = "rate", id(signal)
            if key not in made:
                made[key] = signal.differentiate(dt)
        case Operation("delay", (Symbol(name), Symbol() | Number() as delay)):
            signal = lane.signals[name]
            seconds = delay.value if isinstance(delay, Number) else lane.parameters[delay.name]
            key = "delay", id(signal), float(seconds)
            if key not in made:
                made[key] = signal.delay(max(float(seconds), 0.0), dt)
        case _:
            raise AssertionError(expression)
    return made[key]


def pack_limits(states: Sequence[str], lanes: Sequence[LaneInput]) -> LaneLimits:
    """Return the limits of the states in all lanes."""
    receivers, none = np.zeros(len(states), dtype=np.int64), np.empty(0)
    if not any(lane.limits for lane in lanes):
        return LaneLimits(none, none, receivers, none)
    free = (-np.inf, np.inf)
    bounds = np.array([[(lane.limits or {}).get(name, free) for lane in lanes] for name in states])
    lower, upper = (np.ascontiguousarray(bounds[..., side].reshape(-1)) for side in range(2))
    if not any(lane.spills for lane in lanes):
        return LaneLimits(lower, upper, receivers, none)
    for lane in lanes:
        for name, (receiver, _) in (lane.spills or {}).items():
            receivers[states.index(name)] = states.index(receiver)
    caught = [[(lane.spills or {}).get(name, ("", 0.0))[1] for lane in lanes] for name in states]
    return LaneLimits(lower, upper, receivers, np.array(caught).reshape(-1))


def pack_elements(lanes: Sequence[LaneInput]) -> LaneForces:
    """Return the force laws of all lanes that are calls."""
    first = lanes[0].elements
    if first is None:
        none = np.empty(0, dtype=np.int64)
        return LaneForces(none, none, np.empty((0, LANES, WIDTH)))
    numbers = np.stack([lane.elements.numbers for lane in lanes if lane.elements is not None], axis=1)
    return LaneForces(first.forces, first.state_derivatives, np.ascontiguousarray(numbers))


def make_time(start: float, samples: int, dt: float) -> dict[str, SampledSignal]:
    """Return the time as a signal, under its name in equations."""
    time = start + dt * np.arange(samples, dtype=np.float64)
    return {TIME: SampledSignal(time, time + 0.5 * dt, time + dt)}
