"""Expressions in equations: trees of numbers, names and functions, their text and their value."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np


@dataclass(frozen=True, slots=True)
class Number:
    """A constant."""

    value: float


@dataclass(frozen=True, slots=True)
class Symbol:
    """The name of an input, a channel, a state, a variable, a parameter, ``t`` or ``force``."""

    name: str


@dataclass(frozen=True, slots=True)
class Operation:
    """A function of expressions; operators are functions too, see `FUNCTIONS`."""

    function: str
    arguments: "tuple[OdeExpression, ...]"


OdeExpression: TypeAlias = Number | Symbol | Operation

#: Function of the name of a state or an output: its derivative or its value according to an FMU.
FMU = "fmu"

#: Functions of a signal as a whole: its rate and its delay. They are evaluated before the integration.
SIGNAL_FUNCTIONS: Mapping[str, int] = MappingProxyType({"rate": 1, "delay": 2})


@dataclass(frozen=True, slots=True)
class OdeFunction:
    """A function in equations.

    Attributes
    ----------
    arity : int
        Number of arguments.
    evaluate : callable
        The function of NumPy arrays or numbers. Outside its domain, the value is NaN or infinite.
    summary : str
    """

    arity: int
    evaluate: Callable[..., Any]
    summary: str


#: Functions by name. The operators ``+ - * / **``, the minus sign, ``<`` and ``<=`` are the first ones.
FUNCTIONS: Mapping[str, OdeFunction] = MappingProxyType(
    {
        "add": OdeFunction(2, np.add, "`a + b`"),
        "sub": OdeFunction(2, np.subtract, "`a - b`"),
        "mul": OdeFunction(2, np.multiply, "`a*b`"),
        "div": OdeFunction(2, np.divide, "`a/b`"),
        "pow": OdeFunction(2, np.power, "`a**b`; NaN if a is negative and b is not an integer"),
        "neg": OdeFunction(1, np.negative, "`-a`"),
        "less": OdeFunction(2, lambda a, b: np.less(a, b) * 1.0, "`a < b`: 1 if true, else 0"),
        "less_equal": OdeFunction(2, lambda a, b: np.less_equal(a, b) * 1.0, "`a <= b`: 1 if true, else 0"),
        "abs": OdeFunction(1, np.abs, "absolute value"),
        "sqrt": OdeFunction(1, np.sqrt, "square root; NaN if a is negative"),
        "exp": OdeFunction(1, np.exp, "exponential"),
        "log": OdeFunction(1, np.log, "natural logarithm; NaN if a is negative"),
        "sin": OdeFunction(1, np.sin, "sine"),
        "cos": OdeFunction(1, np.cos, "cosine"),
        "tan": OdeFunction(1, np.tan, "tangent"),
        "tanh": OdeFunction(1, np.tanh, "hyperbolic tangent"),
        "atan": OdeFunction(1, np.arctan, "arc tangent"),
        "sign": OdeFunction(1, np.sign, "-1, 0 or 1"),
        "min": OdeFunction(2, lambda a, b: np.where(a < b, a, b), "the smaller of two or more values"),
        "max": OdeFunction(2, lambda a, b: np.where(a > b, a, b), "the larger of two or more values"),
        "where": OdeFunction(
            3,
            lambda c, a, b: np.where(c > 0.0, a, b),
            "`where(x > y, a, b)`: a if the condition holds, else b",
        ),
    }
)

#: Infix form of a function: operator, precedence, precedence of its left and of its right operand.
_INFIX: Mapping[str, tuple[str, int, int, int]] = MappingProxyType(
    {
        "less": (" < ", 0, 1, 1),
        "less_equal": (" <= ", 0, 1, 1),
        "add": (" + ", 1, 1, 2),
        "sub": (" - ", 1, 1, 2),
        "mul": ("*", 2, 2, 3),
        "div": ("/", 2, 2, 3),
        # A sign binds less than a power on its left, and more than one on its right.
        "pow": ("**", 4, 5, 3),
    }
)

#: Precedence of an expression with a minus sign.
_SIGNED = 3

#: Precedence of a name, a number or a call.
_ATOM = 5


@dataclass(frozen=True, slots=True)
class Notation:
    """How the parts of an expression are written; by default as the parser reads them.

    Attributes
    ----------
    symbol, number : callable
        Text of a name and of a number.
    operators : frozenset of str
        Functions that are written as operators between their operands.
    call : callable
        ``(function, texts of the arguments) -> text`` of any other function.
    """

    symbol: Callable[[str], str] = str
    number: Callable[[float], str] = lambda value: repr(float(value)).removesuffix(".0")
    operators: frozenset[str] = frozenset(_INFIX)
    call: Callable[[str, tuple[str, ...]], str] = lambda name, arguments: f"{name}({', '.join(arguments)})"


_PLAIN = Notation()


def render(expression: OdeExpression, notation: Notation = _PLAIN) -> str:
    """Write an expression as text; the parser converts it back to the expression that it has read."""
    return _render(expression, notation)[0]


def _render(expression: OdeExpression, notation: Notation) -> tuple[str, int]:
    match expression:
        case Number(value):
            text = notation.number(value)
            return text, _SIGNED if text.startswith("-") else _ATOM
        case Symbol(name):
            return notation.symbol(name), _ATOM
        case Operation("neg", (Number(value),)):
            return _render(Number(-value), notation)
        case Operation("neg", (operand,)):
            return f"-{_bracket(operand, _SIGNED, notation)}", _SIGNED
        case Operation(function, (first, second)) if function in notation.operators:
            operator, own, left, right = _INFIX[function]
            return f"{_bracket(first, left, notation)}{operator}{_bracket(second, right, notation)}", own
        case Operation(function, arguments):
            return notation.call(function, tuple(render(each, notation) for each in arguments)), _ATOM


def _bracket(expression: OdeExpression, least: int, notation: Notation) -> str:
    text, precedence = _render(expression, notation)
    return text if precedence >= least else f"({text})"


def find_symbols(expression: OdeExpression) -> Iterator[str]:
    """Yield the names in an expression from left to right, also those of delayed signals and their delays.

    What an FMU computes has no names of the equations.
    """
    match expression:
        case Symbol(name):
            yield name
        case Operation(function, arguments) if function != FMU:
            for argument in arguments:
                yield from find_symbols(argument)


def substitute(expression: OdeExpression, replacements: Mapping[str, OdeExpression]) -> OdeExpression:
    """Return an expression with names replaced by expressions."""
    match expression:
        case Symbol(name):
            return replacements.get(name, expression)
        case Operation(function, arguments):
            return Operation(function, tuple(substitute(each, replacements) for each in arguments))
    return expression


def evaluate(expression: OdeExpression, values: Mapping[str, Any]) -> Any:
    """Evaluate an expression with NumPy.

    Parameters
    ----------
    expression : expression
    values : mapping
        Values of the names, numbers or arrays of equal shape; the values of ``rate(F)``, ``delay(F, tau)``
        and ``fmu(y)`` by their text.

    Returns
    -------
    float or ndarray
    """
    match expression:
        case Number(value):
            return value
        case Symbol(name):
            return values[name]
        case Operation(function, _) if function in SIGNAL_FUNCTIONS or function == FMU:
            return values[render(expression)]
        case Operation(function, arguments):
            given = [evaluate(argument, values) for argument in arguments]
            with np.errstate(all="ignore"):
                return FUNCTIONS[function].evaluate(*given)
