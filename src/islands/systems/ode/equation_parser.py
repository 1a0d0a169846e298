"""Parser of equations: one per line, ``dx/dt = ...`` for a state, ``name = ...`` for a variable.

Expressions are a subset of Python's, so Python's parser is used; nothing is evaluated.
"""

import ast
import keyword
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from islands.errors import ModelError, suggest
from islands.systems.ode.ode_expression import (
    FMU,
    FUNCTIONS,
    SIGNAL_FUNCTIONS,
    Number,
    OdeExpression,
    Operation,
    Symbol,
)

#: Largest number of characters of all equations.
MAX_CHARACTERS = 20_000

#: Largest depth of an expression.
MAX_DEPTH = 200

#: Constants by name.
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": math.pi})

#: Name of the time in seconds.
TIME = "t"

#: Name of the sum of the forces of force laws.
FORCE = "force"

#: Names that have a meaning in every equation.
_MEANINGS = frozenset((*FUNCTIONS, *SIGNAL_FUNCTIONS, *CONSTANTS, TIME, FORCE))

_DERIVATIVE = re.compile(r"d\s*([A-Za-z_]\w*)\s*/\s*dt")

_BINARY: Mapping[type[ast.operator], str] = MappingProxyType(
    {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div", ast.Pow: "pow"}
)

#: Function of a comparison, and whether its operands are exchanged.
_COMPARISONS: Mapping[type[ast.cmpop], tuple[str, bool]] = MappingProxyType(
    {
        ast.Lt: ("less", False),
        ast.LtE: ("less_equal", False),
        ast.Gt: ("less", True),
        ast.GtE: ("less_equal", True),
    }
)

#: Functions that are written by their names; the others are operators.
NAMED_FUNCTIONS = tuple(
    name for name in FUNCTIONS if name not in {*_BINARY.values(), "neg", "less", "less_equal"}
)


@dataclass(frozen=True, slots=True)
class Equation:
    """An equation, and its place for messages.

    Attributes
    ----------
    target : str
        Name of the state or variable.
    is_derivative : bool
        Whether it is the derivative of a state.
    expression : expression
        Right-hand side.
    place : str
        Line number and text.
    """

    target: str
    is_derivative: bool
    expression: OdeExpression
    place: str


def parse_equations(text: str) -> tuple[Equation, ...]:
    """Parse equations, one per line; ``#`` starts a comment.

    Raises
    ------
    ModelError
        A line is not an equation. The message quotes it.
    """
    if len(text) > MAX_CHARACTERS:
        raise ModelError(f"the equations have {len(text)} characters, and {MAX_CHARACTERS} is the most")
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.partition("#")[0].strip()
        if not content:
            continue
        place = f"line {number} of the equations, {content!r}"
        left, equals, right = content.partition("=")
        if not equals:
            raise ModelError(f"{place}: write dNAME/dt = ... for a state, or NAME = ... for a variable")
        derivative = _DERIVATIVE.fullmatch(left.strip())
        target = derivative[1] if derivative else left.strip()
        if not derivative and not target.isidentifier():
            raise ModelError(
                f"{place}: the left side is dNAME/dt for a state, or NAME for a variable, got {target!r}"
            )
        check_name(target, place)
        found.append(Equation(target, derivative is not None, parse_expression(right, place), place))
    return tuple(found)


def check_name(name: str, place: str) -> None:
    """Raise `ModelError` if a name cannot be given to a signal, a state, a variable or a parameter."""
    if not (name.isascii() and name.isidentifier()) or keyword.iskeyword(name):
        raise ModelError(f"{place}: {name!r} is not a name: use letters, digits and _, and no word of Python")
    if name in _MEANINGS:
        raise ModelError(f"{place}: {name!r} already has a meaning in equations: take another name")


def is_free_name(name: str) -> bool:
    """Return whether a name can be given to something in equations, if nothing else there has it."""
    return name.isascii() and name.isidentifier() and not keyword.iskeyword(name) and name not in _MEANINGS


def parse_expression(text: str, place: str = "") -> OdeExpression:
    """Parse an expression.

    Parameters
    ----------
    text : str
        Text in the format of `render`.
    place : str
        Line of the expression, for messages; by default the text itself.

    Raises
    ------
    ModelError
        The text is not an expression, or is nested too deeply.
    """
    place = place or repr(text.strip()[:80])
    if "^" in text:
        raise ModelError(f"{place}: write a power as x**2, not x^2")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        return _read(tree, place, MAX_DEPTH)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        detail = f": {error.msg}" if isinstance(error, SyntaxError) else ""
        raise ModelError(f"{place}: this is not an expression such as (F - c*v - k*x)/m{detail}") from error


def _read(node: ast.expr, place: str, depth: int) -> OdeExpression:
    if depth == 0:
        raise ModelError(f"{place}: nested too deeply: introduce a variable for a part of it")

    def read(child: ast.expr) -> OdeExpression:
        return _read(child, place, depth - 1)

    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int() | float() as value):
            return Number(_check_finite(value, place))
        case ast.Name(id=name):
            return Number(CONSTANTS[name]) if name in CONSTANTS else Symbol(name)
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() | float() as value)) if (
            value is not True and value is not False
        ):
            return Number(-_check_finite(value, place))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return Operation("neg", (read(operand),))
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return read(operand)
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _BINARY:
            return Operation(_BINARY[type(operator)], (read(left), read(right)))
        case ast.Compare(left=left, ops=[operator], comparators=[right]) if type(operator) in _COMPARISONS:
            function, exchanged = _COMPARISONS[type(operator)]
            one, other = (right, left) if exchanged else (left, right)
            return Operation(function, (read(one), read(other)))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _make_call(name, tuple(read(argument) for argument in arguments), place)
    raise ModelError(
        f"{place}: cannot read {ast.unparse(node)!r}: use numbers, names, + - * / **, one comparison with "
        f"< <= > >=, and the functions {', '.join([*NAMED_FUNCTIONS, *SIGNAL_FUNCTIONS])}"
    )


def _check_finite(value: float, place: str) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ModelError(f"{place}: a number is too large")
    return number


def _make_call(name: str, arguments: tuple[OdeExpression, ...], place: str) -> OdeExpression:
    if name in SIGNAL_FUNCTIONS:
        match name, arguments:
            case "rate", (Symbol(),):
                return Operation(name, arguments)
            case "delay", (Symbol(), Symbol() | Number()):
                return Operation(name, arguments)
        raise ModelError(
            f"{place}: write rate(F) and delay(F, tau) with the name of the input or of a channel; "
            "tau is a parameter or a number, in seconds"
        )
    match name, arguments:
        case (called, (Symbol(),)) if called == FMU:
            return Operation(FMU, arguments)
    if name not in NAMED_FUNCTIONS:
        raise ModelError(
            f"{place}: unknown function {name!r}: take one of {', '.join(NAMED_FUNCTIONS)}"
            f"{suggest(name, NAMED_FUNCTIONS)}"
        )
    if name in ("min", "max") and len(arguments) > 2:
        *first, last = arguments
        return Operation(name, (_make_call(name, tuple(first), place), last))
    arity = FUNCTIONS[name].arity
    if len(arguments) != arity:
        raise ModelError(f"{place}: {name} takes {arity} arguments, got {len(arguments)}")
    return Operation(name, arguments)
