"""Parts of a constraint: sums over clusters, equalities, symmetries and signs of parameters.

An equality is one row of ``S theta = c`` whose coefficient for a regressor depends on that regressor alone.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import nan

from islands.expressions.derivatives import differentiate
from islands.expressions.evaluation import value
from islands.expressions.parity import parity
from islands.expressions.tree import Expression
from islands.models.clusters import steady_state
from islands.models.regressor import Regressor


@dataclass(frozen=True, slots=True)
class ClusterSums:
    """Sums of parameters over disjoint groups of regressors.

    Attributes
    ----------
    text : str
    group : callable
        Maps a regressor to its weight in the sum and the key of its group. A weight of 0 means no group.
    sums : mapping
        Nonzero sums of the weighted parameters by group. A structure must contain these groups. The weighted
        parameters of any other group sum to zero.
    lacking : str
        Reason of the failure of a structure that lacks one of these groups.
    """

    text: str
    group: Callable[[Regressor], tuple[float, Expression]]
    sums: Mapping[Expression, float]
    lacking: str


@dataclass(frozen=True, slots=True)
class FixedPoint:
    """The output ybar is an equilibrium for the input ubar: ``sum of theta_i psi_i(ubar, ybar) = ybar``.

    Attributes
    ----------
    text : str
    point : tuple of float
        ybar, then the value of every input.
    """

    text: str
    point: tuple[float, ...]

    @property
    def target(self) -> float:
        """Right-hand side of the equality."""
        return self.point[0]

    @property
    def inputs(self) -> int:
        """Number of inputs that the record must have."""
        return len(self.point) - 1

    def weigh(self, regressor: Regressor) -> float:
        """Return the coefficient of the regressor's parameter: its steady state at the point.

        NaN if the regressor overflows there.
        """
        weight, state = steady_state(regressor)
        try:
            return weight * value(state, lambda channel, _: self.point[channel]) if weight else 0.0
        except (ArithmeticError, ValueError):
            return nan


@dataclass(frozen=True, slots=True)
class StaticGain:
    """The slope G of the static characteristic at an operating point.

    The derivative of ``y = sum of theta_i psi_i(u, y)`` along the characteristic is linear in the parameters:
    ``sum of theta_i (dpsi_i/du + G dpsi_i/dy) = G``.

    Attributes
    ----------
    text : str
    gain : float
        G, in units of the output per unit of the input.
    channel : int
        Number of the input, from 1.
    point : tuple of float
        ybar, then the value of every input; empty for the origin.
    """

    text: str
    gain: float
    channel: int
    point: tuple[float, ...]

    @property
    def target(self) -> float:
        """Right-hand side of the equality."""
        return self.gain

    @property
    def inputs(self) -> int | None:
        """Number of inputs that the record must have; None for any number that contains the channel."""
        return len(self.point) - 1 if self.point else None

    def weigh(self, regressor: Regressor) -> float:
        """Return the coefficient of the regressor's parameter; NaN if the slope is not defined."""
        return self.slope(regressor, self.channel) + self.gain * self.slope(regressor, 0)

    def slope(self, regressor: Regressor, channel: int) -> float:
        """Return the derivative of the regressor's steady state with respect to a channel.

        NaN if it is not defined or the regressor overflows at the operating point.
        """
        weight, state = steady_state(regressor)
        if not weight:
            return 0.0
        try:
            _, slope = differentiate(
                state,
                lambda each: self.point[each] if self.point else 0.0,
                lambda each: float(each == channel),
            )
        except (ArithmeticError, ValueError):
            return nan
        return weight * slope


@dataclass(frozen=True, slots=True)
class LinearEquality:
    """A weighted sum of parameters. A structure without one of the terms has the parameter zero there.

    Attributes
    ----------
    text : str
    weights : mapping
        Weight of the parameter by regressor.
    target : float
    """

    text: str
    weights: Mapping[Regressor, float]
    target: float

    def weigh(self, regressor: Regressor) -> float:
        """Return the coefficient of the regressor's parameter."""
        return self.weights.get(regressor, 0.0)


@dataclass(frozen=True, slots=True)
class Symmetry:
    """A restriction to regressors of one parity, so that the model responds oddly or evenly to its inputs.

    Attributes
    ----------
    text : str
    parity : int
        -1: reversing all inputs reverses the output. 1: reversing all inputs leaves the output as it is.
    """

    text: str
    parity: int

    def admits(self, regressor: Regressor) -> bool:
        """Return whether the parity of the regressor follows from its primitives."""
        first = 0 if self.parity < 0 else 1
        return parity(regressor.expression, lambda channel: channel >= first) == self.parity


@dataclass(frozen=True, slots=True)
class ParameterSign:
    """The sign of one parameter: not negative (1) or not positive (-1)."""

    text: str
    regressor: Regressor
    sign: int


Equality = FixedPoint | StaticGain | LinearEquality
Part = ClusterSums | Equality | Symmetry | ParameterSign
