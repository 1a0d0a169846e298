"""States of a state space at rest: the output and its slopes there, and their derivatives.

The states at rest are implicit in the parameters. The derivatives follow from the implicit function theorem,
with a linear system whose solution serves all parameters (adjoint).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import exp, nan, tanh
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.models.latent import StateSpaceLayout
from islands.models.state_space_rest import Linearised, find_rest, linearise
from islands.models.unit_functions import FUNCTIONS

#: Least argument of the root, below which its slope is constant; see `islands.kernels.state_space`.
_LEAST_ROOT = 1e-6

#: Distance of an output at rest from a stated one, relative to its largest term, at which no other rest is
#: searched for.
_NEAR = 0.01

#: Step of the argument in a difference of the slopes of a unit.
_STEP = 1e-5

#: Second derivatives of the units that are curved.
_CURVATURES: Mapping[str, Callable[[float], float]] = MappingProxyType(
    {
        "tanh": lambda s: -2.0 * tanh(s) * (1.0 - tanh(s) ** 2),
        "square": lambda _: 2.0,
        "cube": lambda s: 6.0 * s,
        "root": lambda s: -0.25 * float(np.sign(s)) * abs(s) ** -1.5 if abs(s) > _LEAST_ROOT else 0.0,
        "bell": lambda s: (4.0 * s * s - 2.0) * exp(-s * s),
    }
)


@dataclass(frozen=True, slots=True, eq=False)
class StateSpaceParameters:
    """Parameters of a state space with static units.

    Attributes
    ----------
    layout : StateSpaceLayout
    theta : ndarray, shape (parameters,)
    codes : ndarray of int64, shape (units,)
        Codes of the units for the kernel.
    """

    layout: StateSpaceLayout
    theta: NDArray[np.float64]
    codes: NDArray[np.int64]

    def with_theta(self, theta: NDArray[np.float64]) -> "StateSpaceParameters":
        """Return the state space with other parameters."""
        return StateSpaceParameters(self.layout, theta, self.codes)


class StaticValue(NamedTuple):
    """A sum, and the largest magnitude of its terms, to which its rounding error is relative."""

    total: float
    largest: float


@dataclass(frozen=True, slots=True, eq=False)
class StaticState:
    """A state space at rest at constant inputs.

    Attributes
    ----------
    system : StateSpaceParameters
    x : ndarray, shape (states,)
    u : ndarray, shape (inputs,)
    at : Linearised
        The system there.
    """

    system: StateSpaceParameters
    x: NDArray[np.float64]
    u: NDArray[np.float64]
    at: Linearised

    @property
    def output(self) -> StaticValue:
        """Output at rest."""
        of = self.system.layout.find_matrices(self.system.theta)
        others = np.concatenate([of["D"] * self.u, of["F"] * self.at.values, of["level"]])
        # The states move about those at rest with the magnitude 1.
        terms = np.concatenate([of["C"] * np.maximum(1.0, np.abs(self.x)), others])
        return StaticValue(float(of["C"] @ self.x + others.sum()), float(np.abs(terms).max()))

    def measure_slope(self, channel: int) -> StaticValue:
        """Return the slope of the static characteristic from an input; NaN with a pole of 1."""
        linear = self.at.system
        try:
            inverse = np.linalg.inv(np.eye(len(self.x)) - linear.A)
        except np.linalg.LinAlgError:
            return StaticValue(nan, 1.0)
        through = linear.C.T * inverse * linear.B[:, channel - 1]
        direct = float(linear.D[0, channel - 1])
        return StaticValue(float(through.sum()) + direct, max(float(np.abs(through).max()), abs(direct)))

    def measure(self, channel: int) -> StaticValue:
        """Return the output for the channel 0, or the slope from an input."""
        return self.measure_slope(channel) if channel else self.output

    def differentiate(self, channel: int) -> NDArray[np.float64]:
        """Return the derivatives of the output, channel 0, or of its slope with respect to all parameters.

        NaN with a pole of 1.
        """
        layout, x, u, at = self.system.layout, self.x, self.u, self.at
        of, found = layout.find_matrices(self.system.theta), np.zeros(self.system.theta.size)
        remainder = np.eye(layout.order) - at.system.A
        try:
            inverse = np.linalg.inv(remainder)
        except np.linalg.LinAlgError:
            return np.full(found.size, np.nan)
        blocks, signals = layout.split(found), np.concatenate([x, u])
        # Effect of an addition to the next states, and to the value of each unit, on the output at rest.
        on_output = at.system.C[0] @ inverse
        effects = on_output @ of["E"] + of["F"]
        if not channel:
            _add_products(blocks, on_output, signals, at.values)
            blocks["o"][...], blocks["level"][...] = on_output, 1.0
            _set(blocks, signals, at.values)
            blocks["s"][...] = at.slopes * effects
            blocks["W"][...] = np.outer(blocks["s"], signals)
            return found
        # Changes of all signals for a unit of the input.
        unit = np.eye(layout.inputs)[channel - 1]
        changes = np.concatenate([inverse @ at.system.B @ unit, unit])
        arguments = np.hstack([of["W"], of["V"]]) @ changes
        bends = _find_curvatures(self.system.codes, at.arguments) * arguments * effects
        shifts = bends @ of["W"] @ inverse
        _add_products(blocks, on_output, changes, at.slopes * arguments)
        _add_products(blocks, shifts, signals, at.values)
        _set(blocks, changes, at.slopes * arguments)
        blocks["o"][...] = shifts
        blocks["s"][...] = bends + at.slopes * (shifts @ of["E"])
        blocks["W"][...] = np.outer(blocks["s"], signals) + np.outer(at.slopes * effects, changes)
        return found


def find_static_state(
    system: StateSpaceParameters,
    u: NDArray[np.float64],
    near: float | None = None,
    start: NDArray[np.float64] | None = None,
) -> StaticState | None:
    """Return a state space at rest at constant inputs; None if it is not found to rest.

    Parameters
    ----------
    system : StateSpaceParameters
    u : ndarray, shape (inputs,)
    near : float or None
        Of several states at rest, take those with the output nearest to this one; None for those that are
        found from states of zero.
    start : ndarray, shape (states,), optional
        Take the states at rest that are found from here.
    """
    of = system.layout.find_matrices(system.theta)
    c = of["C"]

    def find(begin: NDArray[np.float64]) -> StaticState | None:
        x = find_rest(of, system.codes, u, begin)
        return None if x is None else StaticState(system, x, u, linearise(of, system.codes, x, u))

    def measure_distance(rest: StaticState) -> float:
        return abs(rest.output.total - near) if near is not None else 0.0

    first = find(np.zeros(len(c)) if start is None else start)
    if start is not None or near is None:
        return first
    if first is not None and measure_distance(first) <= _NEAR * first.output.largest:
        return first
    change = near - float(of["level"][0] + of["D"] @ u)
    other = find(c * change / (float(c @ c) or 1.0))
    return min(filter(None, (first, other)), key=measure_distance, default=None)


def _set(
    blocks: Mapping[str, NDArray[np.float64]], signals: NDArray[np.float64], values: NDArray[np.float64]
) -> None:
    """Write the derivatives with respect to the parameters of the output."""
    order = blocks["C"].size
    blocks["C"][...], blocks["D"][...], blocks["F"][...] = signals[:order], signals[order:], values


def _add_products(
    blocks: Mapping[str, NDArray[np.float64]],
    effects: NDArray[np.float64],
    signals: NDArray[np.float64],
    values: NDArray[np.float64],
) -> None:
    """Add the derivatives with respect to the factors of the next states, from the effects of these."""
    order = len(effects)
    blocks["A"][...] += np.outer(effects, signals[:order])
    blocks["B"][...] += np.outer(effects, signals[order:])
    blocks["E"][...] += np.outer(effects, values)


def _find_curvatures(codes: NDArray[np.int64], arguments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the second derivatives of the units."""
    pairs = zip(codes.tolist(), arguments.tolist(), strict=True)
    return np.array([_find_curvature(code, s) for code, s in pairs])


def _find_curvature(code: int, s: float) -> float:
    """Return the second derivative of a unit; a difference of the slopes of a tree."""
    # A command that does not simulate loads no kernels.
    from islands.kernels.state_space import evaluate_unit  # noqa: PLC0415

    names = list(FUNCTIONS)
    if code <= len(names):
        curve = _CURVATURES.get(names[code - 1])
        return curve(s) if curve else 0.0
    ahead, behind = (evaluate_unit(code, s + step)[1] for step in (_STEP, -_STEP))
    curvature: float = (ahead - behind) / (2.0 * _STEP)
    return curvature
