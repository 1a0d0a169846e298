"""Differential equations with the simulation of a linear model whose input is held between samples.

A model of first order is a process ``T dx/dt = K u - x``. One of second order with real poles is two such
processes in series, in either order. Gains of the input in each equation and at the output, which are zero
for such a process alone, reproduce any zeros.
"""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
import scipy

from islands.data.channel_names import simplify_unit
from islands.effects.interface.context import Signal
from islands.expressions.parsing import parse_expression
from islands.expressions.tree import Symbol
from islands.simulators.linear import LinearSimulator
from islands.simulators.ode.system import OdeSystem
from islands.simulators.ode.system_parts import OdeEffect, OdeForce, OdeParameter, OdeState

#: Largest order of a model that is written as processes in series.
MAX_ORDER = 2

#: Range of the time constants in sampling times. A faster process follows its input within a sample, and the
#: record does not distinguish a slower one from an integrator.
TIME_CONSTANTS = (0.2, 1e5)

#: Bounds of gains and of the level, relative to the largest gain and to the largest output.
_LIMIT = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class Cascade:
    """Processes of first order in series: ``T_i dx_i/dt = K_i u + x_(i-1) - x_i``.

    The level takes the place of ``x_0``, and the output is ``x_n + D u``.

    Attributes
    ----------
    times, gains : ndarray, shape (order,)
        Time constants in seconds, and the gain of the input in each equation.
    direct : float or None
        Gain of the input at the output; None if it is none by definition.
    level : float
        Output at rest without input.
    dt : float
        Sampling time in seconds.
    """

    times: Signal
    gains: Signal
    direct: float | None
    level: float
    dt: float

    @property
    def states(self) -> list[str]:
        """Names of the states."""
        return ["x"] if self.times.size == 1 else [f"x{place + 1}" for place in range(self.times.size)]

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters by name."""
        numbers = [""] if self.times.size == 1 else [f"{place + 1}" for place in range(self.times.size)]
        found = {f"K{number}": float(gain) for number, gain in zip(numbers, self.gains, strict=True)}
        found |= {f"T{number}": float(time) for number, time in zip(numbers, self.times, strict=True)}
        return found | {"level": self.level} | ({} if self.direct is None else {"D": self.direct})

    def make_system(self, name: str, input_unit: str, output_unit: str, output_peak: float) -> OdeSystem:
        """Return the equations; bounds are relative to the largest gain and to the largest output."""
        gains = [each for each in self.values if each[0] == "K"]
        times = [each for each in self.values if each[0] == "T"]
        before = ["level", *self.states]
        rates = [
            f"({gain}*u + {last} - {state})/{time}"
            for gain, time, last, state in zip(gains, times, before, self.states, strict=False)
        ]
        output = self.states[-1] if self.direct is None else f"{self.states[-1]} + D*u"
        largest = _LIMIT * (float(np.max(np.abs([*self.gains, self.direct or 0.0]))) or 1.0)
        bounds = dict.fromkeys(self.values, (-largest, largest))
        shortest, longest = (factor * self.dt for factor in TIME_CONSTANTS)
        bounds |= dict.fromkeys(times, (shortest, longest))
        most = _LIMIT * max(output_peak, abs(self.level))
        bounds["level"] = (-most, most)
        units = dict.fromkeys(self.values, simplify_unit(f"{output_unit}/{input_unit}"))
        units |= dict.fromkeys(times, "s") | {"level": output_unit}
        return OdeSystem(
            name=name,
            input="u",
            derivatives=tuple(zip(self.states, map(parse_expression, rates), strict=True)),
            variables=(),
            output=parse_expression(output),
            parameters=tuple(
                OdeParameter(each, value, units[each], None, *bounds[each], positive=each in times)
                for each, value in self.values.items()
            ),
            states=tuple(OdeState(each, output_unit, self.level) for each in self.states),
            force=OdeForce("u", "", output_unit, Symbol("u")),
            contains=("offset",),
            # The level is an offset of each state.
            effects=tuple(OdeEffect(f"state-clip:{each}") for each in self.states),
        )

    def find_states(self, u: Signal, output: Signal) -> dict[str, float]:
        """Return the states at the first sample, given the first samples of input and output."""
        order = self.times.size
        step, held = _hold(self.times, self.dt, self.gains[:, None])
        free, forced = np.empty((order, order)), np.zeros(order)
        row, state = np.eye(order)[-1], np.zeros(order)
        for place in range(order):
            free[place], forced[place] = row, state[-1]
            row, state = row @ step, step @ state + held[:, 0] * u[place]
        wanted = output[:order] - self.level - (self.direct or 0.0) * u[:order] - forced
        found = self.level + np.linalg.solve(free, wanted)
        return dict(zip(self.states, found.tolist(), strict=True))


def list_cascades(linear: LinearSimulator, values: Signal, dt: float) -> list[Cascade]:
    """Return the processes in series that simulate what a linear model does, in each order.

    Parameters
    ----------
    linear : LinearSimulator
    values : ndarray, shape (parameters,)
        Values of its parameters.
    dt : float
        Sampling time in seconds.

    Returns
    -------
    list of Cascade
        None if the model has a delay, another order, or poles that are not those of stable processes.
    """
    numerator, denominator, level, _ = linear.split_values(values)
    order = denominator.size
    if linear.delay or not 1 <= order <= MAX_ORDER:
        return []
    poles = np.roots(np.concatenate([[1.0], -denominator]))
    if np.any(np.iscomplex(poles)) or np.any(poles.real <= 0.0) or np.any(poles.real >= 1.0):
        return []
    times = -dt / np.log(poles.real)
    if times.min() < TIME_CONSTANTS[0] * dt or times.max() > TIME_CONSTANTS[1] * dt:
        return []
    direct = float(numerator[0])
    # Response to an impulse of a model without direct term.
    response = np.zeros(order)
    for place in range(order):
        earlier = response[:place][::-1] @ denominator[:place]
        response[place] = numerator[place + 1] + direct * denominator[place] + earlier
    found = []
    for ordered in permutations(sorted(times.tolist(), reverse=True)):
        own = np.array(ordered)
        step, held = _hold(own, dt, np.eye(order))
        rows = np.array([np.linalg.matrix_power(step, place)[-1] @ held for place in range(order)])
        gains = np.linalg.solve(rows, response)
        at_zero = level - (float(gains.sum()) + direct) * linear.reference_input
        found.append(Cascade(own, gains, direct if linear.has_direct_term else None, at_zero, dt))
    return found


def _hold(times: Signal, dt: float, gains: Signal) -> tuple[Signal, Signal]:
    """Return the matrices of states and inputs of processes in series whose inputs are held for a step.

    Parameters
    ----------
    gains : ndarray, shape (order, inputs)
        Gains of the inputs in each equation.
    """
    order, inputs = gains.shape
    rates = np.zeros((order + inputs, order + inputs))
    rates[:order, :order] = (np.eye(order, k=-1) - np.eye(order)) / times[:, None]
    rates[:order, order:] = gains / times[:, None]
    exponential = scipy.linalg.expm(dt * rates)
    return exponential[:order, :order], exponential[:order, order:]
