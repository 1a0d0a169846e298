"""Differential equations with the simulation of a linear model whose input is held between samples.

A model of first order is a process ``T dx/dt = K u - x``. One of second order with real poles is two such
processes in series, in either order, and one with complex poles is an oscillator ``m x'' + c x' + k x = u``.
Gains of the input in each equation and at the output, and of the other state at the output, which are zero
for such a system alone, reproduce any zeros.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import TypeAlias

import numpy as np
import scipy

from islands.effects.interface.context import Signal
from islands.expressions.parsing import parse_expression
from islands.expressions.tree import DELAY, Apply, Constant, Expression, Symbol, substitute
from islands.records.channel_names import simplify_unit
from islands.records.segments import delay_samples
from islands.simulators.linear import LinearSimulator
from islands.simulators.ode.system import OdeEffect, OdeForce, OdeParameter, OdeState, OdeSystem

#: Largest order of a model that is written as differential equations.
MAX_ORDER = 2

#: Range of the time constants in sampling times. A faster process follows its input within a sample, and the
#: record does not distinguish a slower one from an integrator.
TIME_CONSTANTS = (0.2, 1e5)

#: Largest gain of a second equation, relative to that of the first one, of simple processes in series.
_SIMPLE = 0.1

#: Time constants of simple processes in series, relative to that of a single process.
_SPLIT = (0.75, 0.25)

#: Bounds of gains and of the level, relative to the largest gain and to the largest output.
_LIMIT = 20.0

#: Direct term, level, sampling time and delay of `LinearStates`.
_Common: TypeAlias = tuple[float | None, float, float, int]


@dataclass(frozen=True, slots=True, eq=False)
class LinearStates(ABC):
    """Differential equations of a linear model.

    Attributes
    ----------
    direct : float or None
        Gain of the input at the output; None if it is none by definition.
    level : float
        Output at rest without input.
    dt : float
        Sampling time in seconds.
    delay : int
        Input delay in samples.
    """

    direct: float | None
    level: float
    dt: float
    delay: int

    @property
    @abstractmethod
    def states(self) -> list[str]:
        """Names of the states."""

    @property
    @abstractmethod
    def values(self) -> dict[str, float]:
        """Values of the parameters by name."""

    @property
    @abstractmethod
    def fastest(self) -> float:
        """Fastest rate of the system in 1/s."""

    @abstractmethod
    def make_system(self, name: str, input_unit: str, output_unit: str, output_peak: float) -> OdeSystem:
        """Return the equations; bounds are relative to the values and to the largest output."""

    @abstractmethod
    def _realise(self) -> tuple[Signal, Signal, Signal, Signal]:
        """Return the matrix of the states, the gains of the held input, the output row, and the rest."""

    def find_states(self, u: Signal, output: Signal) -> dict[str, float]:
        """Return the states at the first sample, given the first samples of input and output."""
        step, held, row, rest = self._realise()
        order, u = row.size, delay_samples(u, self.delay)
        free, forced, state = np.empty((order, order)), np.zeros(order), np.zeros(order)
        own = row
        for place in range(order):
            free[place], forced[place] = own, row @ state
            own, state = own @ step, step @ state + held * u[place]
        wanted = output[:order] - self.level - (self.direct or 0.0) * u[:order] - forced
        found = rest + np.linalg.solve(free, wanted)
        return dict(zip(self.states, found.tolist(), strict=True))

    def _read(self, text: str) -> Expression:
        """Read an expression whose input is delayed."""
        delayed = Apply(DELAY, (Symbol("u"), Constant(self.delay * self.dt)))
        return substitute(parse_expression(text), {"u": delayed} if self.delay else {})

    def _add_direct(self, output: str) -> Expression:
        """Return the expression of the output, given that without the direct term."""
        return self._read(output if self.direct is None else f"{output} + D*u")

    @property
    def _own_values(self) -> dict[str, float]:
        return {"level": self.level} | ({} if self.direct is None else {"D": self.direct})

    def _bound_level(self, output_peak: float) -> tuple[float, float]:
        most = _LIMIT * max(output_peak, abs(self.level))
        return -most, most


@dataclass(frozen=True, slots=True, eq=False)
class Cascade(LinearStates):
    """Processes of first order in series: ``T_i dx_i/dt = K_i u + x_(i-1) - x_i``.

    The level takes the place of ``x_0``, and the output is ``x_n + D u``.

    Attributes
    ----------
    times, gains : ndarray, shape (order,)
        Time constants in seconds, and the gain of the input in each equation.
    """

    times: Signal
    gains: Signal

    @property
    def states(self) -> list[str]:
        """Names of the states."""
        return ["x"] if self.times.size == 1 else [f"x{place + 1}" for place in range(self.times.size)]

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters by name."""
        numbers = [""] if self.times.size == 1 else [f"{place + 1}" for place in range(self.times.size)]
        values = {f"K{number}": float(gain) for number, gain in zip(numbers, self.gains, strict=True)}
        values |= {f"T{number}": float(time) for number, time in zip(numbers, self.times, strict=True)}
        return values | self._own_values

    @property
    def is_simple(self) -> bool:
        """Whether the input drives only the first process, up to a small part."""
        return bool(np.all(np.abs(self.gains[1:]) < _SIMPLE * np.abs(self.gains[0])))

    @property
    def fastest(self) -> float:
        """Fastest rate in 1/s."""
        return 1.0 / float(self.times.min())

    def make_system(self, name: str, input_unit: str, output_unit: str, output_peak: float) -> OdeSystem:
        """Return the equations; bounds are relative to the largest gain and to the largest output."""
        gains = [each for each in self.values if each[0] == "K"]
        times = [each for each in self.values if each[0] == "T"]
        before = ["level", *self.states]
        rates = [
            f"({gain}*u + {last} - {state})/{time}"
            for gain, time, last, state in zip(gains, times, before, self.states, strict=False)
        ]
        largest = _LIMIT * (float(np.max(np.abs([*self.gains, self.direct or 0.0]))) or 1.0)
        bounds = dict.fromkeys(self.values, (-largest, largest))
        shortest, longest = (factor * self.dt for factor in TIME_CONSTANTS)
        bounds |= dict.fromkeys(times, (shortest, longest))
        bounds["level"] = self._bound_level(output_peak)
        units = dict.fromkeys(self.values, simplify_unit(f"{output_unit}/{input_unit}"))
        units |= dict.fromkeys(times, "s") | {"level": output_unit}
        return OdeSystem(
            name=name,
            input="u",
            derivatives=tuple(zip(self.states, map(self._read, rates), strict=True)),
            variables=(),
            output=self._add_direct(self.states[-1]),
            parameters=tuple(
                OdeParameter(each, value, units[each], None, *bounds[each], positive=each in times)
                for each, value in self.values.items()
            ),
            states=tuple(OdeState(state, output_unit, self.level) for state in self.states),
            force=OdeForce("u", "", output_unit, Symbol("u")),
            contains=("offset",),
            # The level is an offset of each state.
            effects=tuple(
                OdeEffect(f"{limit}:{state}")
                for state in self.states
                for limit in ("state-clip", "state-range")
            ),
        )

    def _realise(self) -> tuple[Signal, Signal, Signal, Signal]:
        step, held = _hold_processes(self.times, self.dt, self.gains[:, None])
        order = self.times.size
        return step, held[:, 0], np.eye(order)[-1], np.full(order, self.level)


@dataclass(frozen=True, slots=True, eq=False)
class LinearOscillator(LinearStates):
    """Mass on a spring and a damper: ``m dv/dt = u + k (level - x) - c v``, ``dx/dt = v``.

    The output is ``x + Z v + D u``. If a sensor shows mainly the speed, it is ``level + v + Z x + D u``, and
    the level is no position.

    Attributes
    ----------
    mass, damping, stiffness : float
    sign : int
        Sign of the input.
    shows_speed : bool
        Whether the output is mainly the speed.
    other : float
        Gain of the other state at the output, in seconds or 1/s.
    """

    mass: float
    damping: float
    stiffness: float
    sign: int
    shows_speed: bool
    other: float

    @property
    def states(self) -> list[str]:
        """Names of the states."""
        return ["x", "v"]

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters by name."""
        own = {"m": self.mass, "c": self.damping, "k": self.stiffness, "Z": self.other}
        return own | self._own_values

    @property
    def fastest(self) -> float:
        """Natural frequency in radians per second."""
        return float(np.sqrt(self.stiffness / self.mass))

    def make_system(self, name: str, input_unit: str, output_unit: str, output_peak: float) -> OdeSystem:
        """Return the equations; bounds are relative to the values and to the largest output."""
        drive = "u" if self.sign > 0 else "-u"
        if self.shows_speed:
            position, speed, spring, output = f"{output_unit} s", output_unit, "- k*x", "v + Z*x + level"
        else:
            position, speed, spring, output = output_unit, f"{output_unit}/s", "+ k*(level - x)", "x + Z*v"
        own = {"m": f"{input_unit} s^2/{position}", "c": f"{input_unit} s/{position}"}
        own |= {"k": f"{input_unit}/{position}", "Z": "1/s" if self.shows_speed else "s"}
        own |= {"level": output_unit, "D": f"{output_unit}/{input_unit}"}
        bounds = self._list_bounds()
        bounds["level"] = self._bound_level(output_peak)
        return OdeSystem(
            name=name,
            input="u",
            derivatives=(
                ("x", Symbol("v")),
                ("v", self._read(f"({drive} {spring} - c*v - force)/m")),
            ),
            variables=(),
            output=self._add_direct(output),
            parameters=tuple(
                OdeParameter(
                    each, value, simplify_unit(own[each]), None, *bounds[each], positive=each in "mck"
                )
                for each, value in self.values.items()
            ),
            states=(OdeState("x", position, 0.0), OdeState("v", speed, 0.0)),
            force=OdeForce("x", "v", input_unit, Symbol("u")),
            contains=("offset", "viscous"),
            effects=(OdeEffect("state-clip:x"), OdeEffect("state-range:x")),
        )

    def _list_bounds(self) -> dict[str, tuple[float | None, float | None]]:
        """Return the bounds of the damping, which another law may replace, and of gains at the output."""
        free: dict[str, tuple[float | None, float | None]] = dict.fromkeys(self.values, (None, None))
        if self.shows_speed:
            other, direct = self.fastest, 1.0 / self.damping
        else:
            other, direct = 1.0 / self.fastest, 1.0 / self.stiffness
        other = _LIMIT * max(abs(self.other), other)
        direct = _LIMIT * max(abs(self.direct or 0.0), direct)
        return free | {"c": (0.0, _LIMIT * self.damping), "Z": (-other, other), "D": (-direct, direct)}

    def _realise(self) -> tuple[Signal, Signal, Signal, Signal]:
        step, held = _hold_oscillator(self.stiffness / self.mass, self.damping / self.mass, self.dt)
        row = np.array([self.other, 1.0] if self.shows_speed else [1.0, self.other])
        rest = np.array([0.0 if self.shows_speed else self.level, 0.0])
        return step, self.sign / self.mass * held, row, rest


def list_states(linear: LinearSimulator, values: Signal, dt: float) -> list[LinearStates]:
    """Return the differential equations that simulate what a linear model does.

    Parameters
    ----------
    linear : LinearSimulator
    values : ndarray, shape (parameters,)
        Values of its parameters.
    dt : float
        Sampling time in seconds.

    Returns
    -------
    list of LinearStates
        Processes in series, in each order, or an oscillator; none if the model has another order, or poles
        that are not those of such a stable system.
    """
    numerator, denominator, level, _ = linear.split_values(values)
    order = denominator.size
    if not 1 <= order <= MAX_ORDER:
        return []
    poles = np.roots(np.concatenate([[1.0], -denominator]))
    direct = float(numerator[0])
    # Response to an impulse of a model without direct term.
    response = np.zeros(order)
    for place in range(order):
        earlier = response[:place][::-1] @ denominator[:place]
        response[place] = numerator[place + 1] + direct * denominator[place] + earlier
    remainder = 1.0 - float(denominator.sum())
    common = (
        direct if linear.has_direct_term else None,
        level - float(numerator.sum()) / remainder * linear.reference_input if remainder else level,
        dt,
        linear.delay,
    )
    if np.any(np.iscomplex(poles)):
        return _list_oscillators(complex(poles[0]), response, common)
    return _list_cascades(np.asarray(poles.real, dtype=np.float64), response, common)


def approximate_cascade(
    linear: LinearSimulator, single: LinearSimulator, known: Sequence[LinearStates], dt: float
) -> Cascade | None:
    """Return two processes in series with the gain and the delay of a single one.

    A model of second order that is fitted to a record with a limited state may have zeros and poles that are
    far from those of the plant.

    Parameters
    ----------
    linear : LinearSimulator
        Model of second order.
    single : LinearSimulator
        Model of first order of the same record.
    known : sequence of LinearStates
        Differential equations of the model of second order.
    dt : float
        Sampling time in seconds.

    Returns
    -------
    Cascade or None
        None if the model has another order, or is such processes already, or if the single one is no stable
        process.
    """
    cascades = [each for each in known if isinstance(each, Cascade)]
    if linear.denominator.size != MAX_ORDER or any(cascade.is_simple for cascade in cascades):
        return None
    pole = float(single.denominator[0])
    if not 0.0 < pole < 1.0:
        return None
    gain = float(single.numerator.sum()) / (1.0 - pole)
    direct = 0.0 if linear.has_direct_term else None
    shortest, longest = (factor * dt for factor in TIME_CONSTANTS)
    times = np.clip(-dt / np.log(pole) * np.array(_SPLIT), shortest, longest)
    level = single.level - gain * single.reference_input
    return Cascade(direct, level, dt, linear.delay, times, np.array([gain, 0.0]))


def _list_cascades(poles: Signal, response: Signal, common: _Common) -> list[LinearStates]:
    """Return processes in series in each order, given their response to an impulse."""
    dt = common[2]
    if np.any(poles <= 0.0) or np.any(poles >= 1.0):
        return []
    times = -dt / np.log(poles)
    if times.min() < TIME_CONSTANTS[0] * dt or times.max() > TIME_CONSTANTS[1] * dt:
        return []
    found: list[LinearStates] = []
    for ordered in permutations(sorted(times.tolist(), reverse=True)):
        own = np.array(ordered)
        step, held = _hold_processes(own, dt, np.eye(own.size))
        rows = np.array([np.linalg.matrix_power(step, place)[-1] @ held for place in range(own.size)])
        found.append(Cascade(*common, own, np.linalg.solve(rows, response)))
    return found


def _list_oscillators(pole: complex, response: Signal, common: _Common) -> list[LinearStates]:
    """Return the oscillator with a pole and its conjugate, given its response to an impulse."""
    rate = complex(np.log(pole)) / common[2]
    if rate.real >= 0.0:
        return []
    square, damping = abs(rate) ** 2, -2.0 * rate.real
    step, held = _hold_oscillator(square, damping, common[2])
    position, speed = np.linalg.solve(np.array([held, step @ held]), response).tolist()
    shows_speed = abs(position) < abs(speed) * float(np.sqrt(square))
    gain, other = (speed, position) if shows_speed else (position, speed)
    if gain == 0.0:
        return []
    mass = 1.0 / abs(gain)
    return [
        LinearOscillator(
            *common,
            *(mass, damping * mass, square * mass),
            sign=1 if gain > 0.0 else -1,
            shows_speed=shows_speed,
            other=other / gain,
        )
    ]


def _hold_processes(times: Signal, dt: float, gains: Signal) -> tuple[Signal, Signal]:
    """Return the matrices of states and inputs of processes in series whose inputs are held for a step.

    Parameters
    ----------
    gains : ndarray, shape (order, inputs)
        Gains of the inputs in each equation.
    """
    rates = (np.eye(times.size, k=-1) - np.eye(times.size)) / times[:, None]
    return _hold(rates, gains / times[:, None], dt)


def _hold_oscillator(stiffness: float, damping: float, dt: float) -> tuple[Signal, Signal]:
    """Return the matrix of states and the gains of the input of an oscillator with a mass of one."""
    step, held = _hold(np.array([[0.0, 1.0], [-stiffness, -damping]]), np.array([[0.0], [1.0]]), dt)
    return step, held[:, 0]


def _hold(rates: Signal, gains: Signal, dt: float) -> tuple[Signal, Signal]:
    """Return the matrices of states and inputs of a system whose inputs are held for a step."""
    order, inputs = gains.shape
    extended = np.zeros((order + inputs, order + inputs))
    extended[:order, :order], extended[:order, order:] = rates, gains
    exponential = scipy.linalg.expm(dt * extended)
    return exponential[:order, :order], exponential[:order, order:]
