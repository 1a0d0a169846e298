"""Linear model of any order, and its estimation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Site
from islands.effects.interface.force import sum_output_forces
from islands.errors import RecordError
from islands.kernels.linear_filter import filter_linearly
from islands.records.dataset import Dataset
from islands.records.segments import delay_samples
from islands.simulators.interface import Forces, SimulationRun, Simulator

#: Iterations of the method of Steiglitz and McBride.
_ITERATIONS = 12

#: Typical change of a coefficient: relative to the largest one in the numerator, absolute in the denominator.
_SCALE = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class LinearSimulator(Simulator):
    """``A(q) (y - level) = B(q) (u - reference input)``, with an input delay and an initial state.

    There are as many poles as zeros.

    Attributes
    ----------
    numerator, denominator : ndarray, shapes (order + 1,) and (order,)
        Coefficients of u(k - delay), u(k - delay - 1), ... and of y(k-1), y(k-2), ..., both on the right-hand
        side.
    level : float
        Output at rest, at the reference input.
    reference_input : float
    delay : int
        Input delay in samples.
    unit : str
        Unit of the output.
    parameters : tuple of Parameter
        Coefficients, level, and state of the filter at the first sample.
    has_direct_term : bool
        Whether b0 is a parameter; otherwise it is zero, and the model is strictly proper.
    state_at_rest : ndarray, shape (order,)
        State of the filter at rest at an input of one; zero without such an equilibrium. It is that of the
        nominal coefficients, so that it remains finite while a pole passes through one.
    """

    numerator: Signal
    denominator: Signal
    level: float
    reference_input: float
    delay: int
    unit: str
    has_direct_term: bool = True
    parameters: tuple[Parameter, ...] = field(init=False)
    state_at_rest: Signal = field(init=False)
    sites: ClassVar[frozenset[Site]] = frozenset((Site.INPUT, Site.FORCE, Site.OUTPUT))
    built_in_effects: ClassVar[frozenset[str]] = frozenset(("offset",))

    @property
    def name(self) -> str:
        """Name on the command line, with the order, and the delay if there is one."""
        return f"linear:{self.denominator.size}{f':{self.delay}' if self.delay else ''}"

    @property
    def equations(self) -> str:
        """Difference equation, and where output and input are counted from."""
        inputs = [f"b{lag} u({_write_time(self.delay + lag)})" for lag in range(self.numerator.size)]
        outputs = [f"a{lag} y({_write_time(lag)})" for lag in range(1, self.denominator.size + 1)]
        terms = " + ".join([*outputs, *inputs])
        return f"y(k) = {terms}, where y is counted from the level and u from {self.reference_input:g}"

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", self._list_parameters())
        object.__setattr__(self, "state_at_rest", self._find_state_at_rest())

    def _list_parameters(self) -> tuple[Parameter, ...]:
        order = self.denominator.size
        gain = _SCALE * float(np.max(np.abs(self.numerator))) or _SCALE
        return (
            *(Parameter(f"b{lag}", "", float(self.numerator[lag]), gain) for lag in self._list_lags()),
            *(Parameter(f"a{lag + 1}", "", float(a), _SCALE) for lag, a in enumerate(self.denominator)),
            Parameter("level", self.unit, self.level, _SCALE * abs(self.level) + gain),
            *(Parameter(f"state {1 + place}", self.unit, 0.0, gain, initial=True) for place in range(order)),
        )

    def _list_lags(self) -> range:
        """Return the lags of the coefficients of the input that are parameters."""
        return range(0 if self.has_direct_term else 1, self.numerator.size)

    def split_values(self, values: Signal) -> tuple[Signal, Signal, float, Signal]:
        """Return numerator, denominator, level, and state at the first sample, given all parameters."""
        order = self.denominator.size
        numerator = np.zeros(order + 1)
        lags = self._list_lags()
        numerator[lags.start :] = values[: len(lags)]
        own = values[len(lags) :]
        return numerator, own[:order], float(own[order]), own[order + 1 :]

    def simulate(
        self,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate the output; see `Simulator.simulate`."""
        output: Signal = self.simulate_batch([SimulationRun(values, x, effect_parameters, forces)], context)[
            0
        ]
        return output

    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate several runs; those with the same input share its delay, and equal forces."""
        inputs = {run.input_key: run.apply_characteristic(run.x, context.dt) for run in runs}
        deviations = {key: delay_samples(x, self.delay) - self.reference_input for key, x in inputs.items()}
        outputs = np.empty((len(runs), runs[0].x.size))
        for row, run in zip(outputs, runs, strict=True):
            numerator, denominator, level, state = self.split_values(run.values)
            # The input is constant before the first sample; the state is a deviation from that equilibrium.
            state = state + (inputs[run.input_key][0] - self.reference_input) * self.state_at_rest
            poles = np.concatenate([[1.0], -denominator])
            row[:] = level + filter_linearly(numerator, poles, deviations[run.input_key], state)
        if runs[0].forces:
            coordinates = [inputs[run.input_key] for run in runs]
            outputs += sum_output_forces(coordinates, context, [run.forces for run in runs])
        return outputs[:, ::every]

    def simulate_at_rest(self, u: Signal) -> Signal:
        """Simulate the output of the nominal values, from the rest at the reference input."""
        poles = np.concatenate([[1.0], -self.denominator])
        deviations = delay_samples(u, self.delay) - self.reference_input
        return self.level + filter_linearly(self.numerator, poles, deviations)

    def _find_state_at_rest(self) -> Signal:
        remainder = 1.0 - float(self.denominator.sum())
        gain = float(self.numerator.sum()) / remainder if remainder > 0.0 else 0.0
        state: Signal = np.cumsum((self.numerator[1:] + gain * self.denominator)[::-1])[::-1]
        return state if remainder > 0.0 else np.zeros_like(state)


def _write_time(lag: int) -> str:
    return f"k-{lag}" if lag else "k"


def estimate_linear(order: int, delay: int, record: Dataset) -> LinearSimulator:
    """Estimate a linear model by the method of Steiglitz and McBride (1965).

    The iteration with the least squared simulation error is returned; a static gain if no model is stable. Of
    several recordings, the longest one is used.

    Raises
    ------
    RecordError
        The record has fewer than ten samples per estimated parameter, the delay not counted.
    """
    record = record.longest_segment
    u, y = record.u[:, 0], record.y
    if record.samples < 10 * (2 * order + 2) + delay:
        raise RecordError(
            f"{record.samples} samples are too few to estimate a linear model of order {order}: take a lower "
            "order or a longer record"
        )
    delayed = delay_samples(u, delay) - u[0]
    best, smallest = None, np.inf
    denominator = np.zeros(order)
    for _ in range(_ITERATIONS):
        prefilter = np.concatenate([[1.0], -denominator])
        numerator, denominator, level = _least_squares(delayed, y, order, prefilter)
        if order and np.max(np.abs(np.roots(np.concatenate([[1.0], -denominator])))) >= 1.0:
            break
        simulated = level + filter_linearly(numerator, np.concatenate([[1.0], -denominator]), delayed)
        mean_square = float(np.mean((y - simulated)[order + delay :] ** 2))
        if mean_square < smallest:
            best, smallest = (numerator, denominator, level), mean_square
    if best is None:  # no iteration gave a stable model: use a static gain
        best = (np.append(np.ptp(y) / (np.ptp(u) or 1.0), np.zeros(order)), np.zeros(order), float(y.mean()))
    return LinearSimulator(*best, float(u[0]), delay, record.output_unit or "1")


def _least_squares(u: Signal, y: Signal, order: int, prefilter: Signal) -> tuple[Signal, Signal, float]:
    """Fit the coefficients and the level to prefiltered signals."""
    filtered_u = filter_linearly([1.0], prefilter, u)
    filtered_y = filter_linearly([1.0], prefilter, y - y[0])
    constant = filter_linearly([1.0], prefilter, np.ones(y.size))
    rows = y.size - order
    columns = [filtered_u[order - lag : order - lag + rows] for lag in range(order + 1)]
    columns += [filtered_y[order - lag : order - lag + rows] for lag in range(1, order + 1)]
    columns.append(constant[order:])
    weights = np.linalg.lstsq(np.column_stack(columns), filtered_y[order:], rcond=None)[0]
    numerator, denominator = weights[: order + 1], weights[order + 1 : 2 * order + 1]
    at_rest = float(weights[-1]) / (1.0 - float(denominator.sum()) or 1.0)
    return numerator, denominator, float(y[0]) + at_rest
