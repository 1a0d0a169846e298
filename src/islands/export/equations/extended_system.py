"""Equations of an extended simulation: those of its system with the terms, maps and forces of its effects.

They are derived from what the effects declare: the terms that a system lists, the expressions of force laws,
and the equations of maps.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from islands.expressions.tree import Expression
from islands.models.block import Block
from islands.simulators.ode.system import OdeSystem


@dataclass(frozen=True, slots=True)
class NamedValue:
    """A parameter or a state at the first sample."""

    value: float
    unit: str = ""


@dataclass(frozen=True, slots=True)
class SignalMap:
    """Map of the input or of the output; see `MapEquation`.

    Attributes
    ----------
    effect, summary : str
    equation : expression
        Of ``x``, ``t``, names of values, and the results ``z0``, ``z1``, ... of the operators.
    operators : tuple of (str, tuple of expression)
        Name and arguments of each operator. The argument of ``temperature`` and ``coupled`` is the name of
        the channel.
    """

    effect: str
    summary: str
    equation: Expression
    operators: tuple[tuple[str, tuple[Expression, ...]], ...]


@dataclass(frozen=True, slots=True)
class OutputForce:
    """Force that is added to the output, on the input as its coordinate.

    Attributes
    ----------
    effect : str
    force : expression
        Of the coordinate ``x``, its rate ``v``, names of values and of the state.
    state : str
        Name of its state; empty if it has none.
    slope : expression or None
        Derivative of the state.
    """

    effect: str
    force: Expression
    state: str = ""
    slope: Expression | None = None


@dataclass(frozen=True, slots=True)
class StateLimit:
    """Limits of a state; None for none. ``caught`` of what the upper one cuts off goes to ``receiver``."""

    lower: Expression | None
    upper: Expression | None
    receiver: str = ""
    caught: Expression | None = None


@dataclass(frozen=True, slots=True)
class SampledCore:
    """Assignments that compute the simulated output ``y_sim`` sample by sample.

    Attributes
    ----------
    summary : str
        What is computed, for the heading of a program.
    before : tuple of (str, expression)
        Memory before the first sample, as expressions of the first input ``x``, values and states.
    output : expression or None
        Output, an expression of the input ``x``, the memory and values. None for that of the model or of the
        column.
    after : tuple of (str, expression)
        Memory after a sample, with the output as ``y`` in addition.
    delay : int
        Samples by which the input ``x`` is delayed.
    block : Block or None
        Identified model in free run from measured outputs.
    columns : mapping
        Further columns of the record, by the names that the program gives to them.
    values, start : mapping
        Parameters, and states at the first sample.
    """

    summary: str
    before: tuple[tuple[str, Expression], ...] = ()
    output: Expression | None = None
    after: tuple[tuple[str, Expression], ...] = ()
    delay: int = 0
    block: Block | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, NamedValue] = field(default_factory=dict)
    start: Mapping[str, NamedValue] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ExtendedEquations:
    """All that a program of an extended simulation computes.

    Attributes
    ----------
    system : OdeSystem
        Equations with the terms of effects; their parameters are in ``values``.
    columns : mapping
        Columns of the record by the names that the program gives to them: the input and the channels.
    output : str
        Column of the output.
    values : mapping
        Parameters by name, also those of effects.
    start : mapping
        States at the first sample by name, also those of force laws.
    limits : mapping
        By name of the state.
    input_maps, output_maps : tuple of SignalMap
        In the order in which they act.
    characteristic : expression or None
        Static characteristic of the interpolated input ``x``, behind the maps of the input; None for none.
    moment_maps : tuple of SignalMap
        Maps of the interpolated input at the start, in the middle and at the end of each step, in the order
        of time, instead of a characteristic; empty if none of them has a memory.
    forces : tuple of OutputForce
    gain : expression or None
        Factor of the gain over the time ``t``; None for one.
    gain_signal : str
        Signal in the equations that is this factor; empty if the input is multiplied.
    hold : str
        Input between samples: ``first-order``, ``zero-order`` or ``band-limited``.
    times, steps : int
        Parts of a sample into which the input is interpolated, and integration steps of each.
    dt : float
        Sampling time in seconds.
    fitted : int
        Samples of the estimation part of the record that was diagnosed.
    effects : tuple of str
        Effects with their equations in words.
    core : SampledCore or None
        Simulation in discrete time, whose output the equation of the output reads; None for a system with
        derivatives.
    """

    system: OdeSystem
    columns: Mapping[str, str]
    output: str
    values: Mapping[str, NamedValue]
    start: Mapping[str, NamedValue]
    hold: str
    times: int
    steps: int
    dt: float
    fitted: int
    limits: Mapping[str, StateLimit] = field(default_factory=dict)
    input_maps: tuple[SignalMap, ...] = ()
    output_maps: tuple[SignalMap, ...] = ()
    characteristic: Expression | None = None
    moment_maps: tuple[SignalMap, ...] = ()
    forces: tuple[OutputForce, ...] = ()
    gain: Expression | None = None
    gain_signal: str = ""
    effects: tuple[str, ...] = ()
    core: SampledCore | None = None

    @property
    def has_kinks(self) -> bool:
        """Whether maps act on the input between samples, so that it may have kinks there."""
        return self.characteristic is not None or bool(self.moment_maps)
