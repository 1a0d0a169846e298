"""Parts of a system of equations: parameters, states, the coordinate of forces, effects."""

from dataclasses import dataclass
from math import inf

from islands.expressions.tree import Expression

#: Name of the value of an effect in its term.
EFFECT_VALUE = "value"


@dataclass(frozen=True, slots=True)
class OdeParameter:
    """A parameter of the equations.

    Attributes
    ----------
    name : str
    value : float
        Nominal value.
    unit : str
    tolerance : float or None
        Relative standard deviation of the true value about the nominal one; None if it is not known.
    lower, upper : float or None
        Bounds of a calibration; by default a twentieth and twenty times the value.
    fixed : bool
        Whether the value is exact, so that it is not calibrated.
    positive : bool
        Whether only positive values are physically possible, as of a mass.
    """

    name: str
    value: float
    unit: str = ""
    tolerance: float | None = None
    lower: float | None = None
    upper: float | None = None
    fixed: bool = False
    positive: bool = False


@dataclass(frozen=True, slots=True)
class OdeState:
    """A state: the solution of an equation ``dx/dt = ...``.

    Attributes
    ----------
    name : str
    unit : str
    initial : float or None
        Value at the first sample, nominal if it is estimated. None for the measured output if that is the
        state itself, otherwise zero.
    fixed : bool
        Whether the initial value is exact, so that it is not estimated.
    lower, upper : float
        Limits, such as the stops of a cylinder: the state does not leave them.
    spills_into : str
        State that receives a part of what a limit of this one cuts off, such as the next tank; empty if
        nothing does.
    """

    name: str
    unit: str = ""
    initial: float | None = None
    fixed: bool = False
    lower: float = -inf
    upper: float = inf
    spills_into: str = ""


@dataclass(frozen=True, slots=True)
class OdeForce:
    """Coordinate that force laws act on; the equations contain their sum as ``force``.

    Attributes
    ----------
    coordinate, rate : str
        Names of the states or variables that are the coordinate and its rate. If the coordinate is the input,
        forces are added to the output, and the rate is empty.
    unit : str
        Unit of a force; by default that of the input.
    drive : expression
        Signal whose peak is a typical force, by default the input.
    """

    coordinate: str
    rate: str
    unit: str
    drive: Expression


@dataclass(frozen=True, slots=True)
class OdeEffect:
    """A term of one equation that is absent unless an effect is active.

    Attributes
    ----------
    name : str
        Name of the effect, such as ``relaxation`` or ``input-offset:x``.
    equation : str
        State, variable or ``output`` whose equation gets the term.
    term : expression or None
        Term with ``value`` for the value of the effect. None for a limit of a state.
    """

    name: str
    equation: str = ""
    term: Expression | None = None
