"""Systems of ordinary differential equations: states, parameters, equations, and the output."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

from islands.errors import ModelError, suggest
from islands.expressions.parsing import parse_expression
from islands.expressions.primitives import ADD, MUL
from islands.expressions.printing import render
from islands.expressions.tree import (
    FMU,
    SIGNAL_FUNCTIONS,
    Apply,
    Expression,
    Symbol,
    find_symbols,
    substitute,
    walk,
)
from islands.simulators.ode.equation_parser import FORCE, TIME, check_name

#: Name of the value of an effect in its term.
EFFECT_VALUE = "value"

#: Target of `OdeSystem.with_term` for a term that is added to the output.
OUTPUT = "output"


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


@dataclass(frozen=True, slots=True)
class OdeSystem:
    """States x with ``dx/dt = f(x, u, parameters, t)`` and one output, as expressions.

    A system is immutable and is not compiled, so that an extended system is as cheap as the original one.

    Attributes
    ----------
    name, summary : str
    input : str
        Name of the signal that drives the system.
    channels : tuple of str
        Names of further measured signals that the equations read.
    derivatives : tuple of (str, expression)
        Derivative of every state, in the order of the states.
    variables : tuple of (str, expression)
        Intermediate variables, in any order.
    output : expression
    parameters : tuple of OdeParameter
    states : tuple of OdeState
    force : OdeForce or None
        Where force laws act; None if they cannot.
    input_unit, output_unit : str
        Units that the equations assume; empty if those of the record are taken.
    steps : int
        Integration steps per sample; 0 for as few as the record requires.
    gain : str
        Parameter that the effects ``gain-step`` and ``ageing`` multiply; empty for the input.
    contains : tuple of str
        Names of effects of the catalogue that the equations contain.
    effects : tuple of OdeEffect
        Effects in the equations; empty for an offset and a limit of each state.
    shooting : float
        Seconds after which a simulation restarts from states that are fitted to the measured output; 0 for a
        free run.
    is_built_in : bool
        Whether these are the equations of the built-in simulator of this name.
    of_fmu : tuple of str
        States whose derivatives, and outputs whose values, an FMU computes: ``fmu(NAME)`` in the equations.
    definitions : tuple of str
        States whose derivatives by the FMU are merely other states.
    simulated : tuple of str
        Outputs of other simulations, which the equation of the output reads.
    """

    name: str
    input: str
    derivatives: tuple[tuple[str, Expression], ...]
    variables: tuple[tuple[str, Expression], ...]
    output: Expression
    parameters: tuple[OdeParameter, ...]
    states: tuple[OdeState, ...]
    summary: str = ""
    channels: tuple[str, ...] = ()
    force: OdeForce | None = None
    input_unit: str = ""
    output_unit: str = ""
    steps: int = 0
    gain: str = ""
    contains: tuple[str, ...] = ()
    effects: tuple[OdeEffect, ...] = ()
    shooting: float = 0.0
    is_built_in: bool = False
    of_fmu: tuple[str, ...] = ()
    definitions: tuple[str, ...] = ()
    simulated: tuple[str, ...] = ()

    @property
    def balances(self) -> tuple[str, ...]:
        """Names of the states whose equations do not merely define a rate, as ``dx/dt = v`` does."""
        return tuple(
            name
            for name, right in self.derivatives
            if not isinstance(right, Symbol) and name not in self.definitions
        )

    def write_equations(self) -> str:
        """Write the equations in one line, as ``dx/dt = v; dv/dt = (u - k*x)/m; output = x``."""
        parts = [f"{name} = {render(right)}" for name, right in self.variables]
        parts += [f"d{name}/dt = {render(right)}" for name, right in self.derivatives]
        return "; ".join([*parts, f"output = {render(self.output)}"])

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the input and of the channels."""
        return (self.input, *self.channels)

    def with_term(
        self, target: str, term: str | Expression, parameters: Sequence[OdeParameter] = ()
    ) -> "OdeSystem":
        """Return the system with one more term in one equation.

        Parameters
        ----------
        target : str
            A state, to whose derivative the term is added, a variable, or ``output``.
        term : str or expression
        parameters : sequence of OdeParameter
            New parameters in the term.

        Raises
        ------
        ModelError
            There is no such equation, the term has an unknown name, or a new parameter has the name of
            something else.
        """
        place = repr(term) if isinstance(term, str) else repr(render(term))
        added = parse_expression(term, place) if isinstance(term, str) else term
        known = self.find_names()
        for parameter in parameters:
            check_name(parameter.name, place)
            if parameter.name in known:
                raise ModelError(f"{place}: {parameter.name!r} has a meaning already: take another name")
        extended = replace(self, parameters=(*self.parameters, *parameters), is_built_in=False)
        check_symbols(added, extended, place)
        if target != OUTPUT and target not in {name for name, _ in (*self.derivatives, *self.variables)}:
            raise ModelError(f"there is no equation of {target!r}: {_list_known(target, known)}")
        extended = extended._add(target, added)
        sort_variables(extended)
        return extended

    def with_effect(self, effect: OdeEffect) -> "OdeSystem":
        """Return the system with the term of an effect, whose name is that of a new parameter."""
        assert effect.term is not None
        parameters = (*self.parameters, OdeParameter(effect.name, 0.0))
        term = substitute(effect.term, {EFFECT_VALUE: Symbol(effect.name)})
        return replace(self, parameters=parameters)._add(effect.equation, term)

    def with_factor(self, parameter: str, factor: str) -> "OdeSystem":
        """Return the system with a parameter multiplied by a signal, which is one more channel."""
        product = Apply(MUL, (Symbol(parameter), Symbol(factor)))

        def multiply(
            equations: Iterable[tuple[str, Expression]],
        ) -> tuple[tuple[str, Expression], ...]:
            return tuple((name, substitute(right, {parameter: product})) for name, right in equations)

        return replace(
            self,
            channels=(*self.channels, factor),
            derivatives=multiply(self.derivatives),
            variables=multiply(self.variables),
            output=substitute(self.output, {parameter: product}),
        )

    def _add(self, target: str, added: Expression) -> "OdeSystem":
        """Return the system with one more term in one equation, without checks."""

        def add(equations: Iterable[tuple[str, Expression]]) -> tuple[tuple[str, Expression], ...]:
            return tuple(
                (name, Apply(ADD, (right, added)) if name == target else right) for name, right in equations
            )

        if target == OUTPUT:
            return replace(self, output=Apply(ADD, (self.output, added)))
        return replace(self, derivatives=add(self.derivatives), variables=add(self.variables))

    def with_values(self, values: Mapping[str, float]) -> "OdeSystem":
        """Return the system with other nominal values of parameters; other names are ignored."""
        return replace(
            self,
            parameters=tuple(
                replace(each, value=float(values.get(each.name, each.value))) for each in self.parameters
            ),
        )

    def find_names(self) -> dict[str, str]:
        """Return the meaning of each name in expressions."""
        return {
            TIME: "the time",
            **({FORCE: "the sum of the forces"} if self.force and self.force.rate else {}),
            self.input: "the input",
            **dict.fromkeys(self.channels, "a channel"),
            **dict.fromkeys(self.simulated, "the simulated output"),
            **dict.fromkeys((name for name, _ in self.derivatives), "a state"),
            **dict.fromkeys((name for name, _ in self.variables), "a variable"),
            **{each.name: "a parameter" for each in self.parameters},
        }


def sort_variables(system: OdeSystem) -> tuple[str, ...]:
    """Return the names of the variables in an order in which each one follows those that it depends on.

    Raises
    ------
    ModelError
        Variables depend on each other in a cycle.
    """
    right_sides = dict(system.variables)
    if system.force is not None and system.force.rate:
        # The forces are computed from the coordinate and its rate.
        right_sides[FORCE] = Apply(ADD, (Symbol(system.force.coordinate), Symbol(system.force.rate)))
    ordered: dict[str, None] = {}
    open_names: list[str] = []

    def visit(name: str) -> None:
        if name in ordered or name not in right_sides:
            return
        if name in open_names:
            cycle = " -> ".join([*open_names[open_names.index(name) :], name])
            raise ModelError(
                f"the variables depend on each other: {cycle}. Solve for one of them, or make it a state"
            )
        open_names.append(name)
        for each in find_symbols(right_sides[name]):
            visit(each)
        open_names.pop()
        ordered[name] = None

    for name in right_sides:
        visit(name)
    return tuple(name for name in ordered if name != FORCE)


def check_symbols(expression: Expression, system: OdeSystem, place: str) -> None:
    """Raise `ModelError` if an expression has an unknown name, or a rate or delay of what is not measured."""
    known = system.find_names()
    for name in find_symbols(expression):
        if name == FORCE and name not in known:
            raise ModelError(f"{place}: force needs a table [force] with a coordinate and its rate")
        if name not in known:
            raise ModelError(f"{place}: unknown name {name!r}: {_list_known(name, known)}")
    _check_signals(expression, system, place)


def _check_signals(expression: Expression, system: OdeSystem, place: str) -> None:
    for part in walk(expression):
        _check_signal(part, system, place)


def _check_signal(part: Expression, system: OdeSystem, place: str) -> None:
    match part:
        case Apply(function, (Symbol(name), *others)) if function in SIGNAL_FUNCTIONS:
            if name not in system.signals:
                raise ModelError(
                    f"{place}: {function.name}({name}) is not possible, since {name} is not measured: "
                    f"take the input or a channel ({', '.join(system.signals)})"
                )
            for other in others:
                if isinstance(other, Symbol) and system.find_names()[other.name] != "a parameter":
                    raise ModelError(f"{place}: the delay {other.name} has to be a parameter or a number")
        case Apply(function, (Symbol(name),)) if function == FMU:
            if name not in system.of_fmu:
                known = ", ".join(system.of_fmu) or "none here, since the simulation is no FMU"
                raise ModelError(f"{place}: an FMU does not compute {name}: take one of {known}")


def _list_known(name: str, known: Mapping[str, str]) -> str:
    return (
        f"known are {', '.join(known)}; define others by an equation, in [parameters], or as the input or a "
        f"channel{suggest(name, known)}"
    )
