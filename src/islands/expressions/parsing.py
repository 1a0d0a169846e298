"""Parser of expressions in plain text, for regressors of models and for equations of simulations.

Both syntaxes are subsets of Python's, except for the caret in models, so Python's parser is used; nothing is
evaluated. Their differences are in `MODEL_SYNTAX` and `EQUATION_SYNTAX`.
"""

import ast
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from islands.errors import ModelError, suggest
from islands.expressions.primitives import (
    ADD,
    DIV,
    EQUATION_FUNCTIONS,
    LESS,
    LESS_EQUAL,
    MUL,
    NEG,
    POW,
    PRIMITIVES,
    SUB,
)
from islands.expressions.printing import LARGEST_POWER
from islands.expressions.tree import (
    FMU,
    SIGNAL_FUNCTIONS,
    Apply,
    Constant,
    Expression,
    Lagged,
    Primitive,
    Shift,
    Symbol,
    name_function,
)

#: Largest depth of an expression in an equation.
MAX_DEPTH = 200

#: Constants in equations by name.
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": math.pi})

#: Functions of equations that are written by their names; the others are operators.
NAMED_FUNCTIONS = tuple(
    name
    for name, function in EQUATION_FUNCTIONS.items()
    if function not in (ADD, SUB, MUL, DIV, POW, NEG, LESS, LESS_EQUAL)
)

_SIGNAL = re.compile(r"y|u([1-9][0-9]*)?")
_BACK_SHIFT = re.compile(r"q([0-9]+)")


@dataclass(frozen=True, slots=True)
class Syntax:
    """Rules of a text.

    Attributes
    ----------
    functions : mapping
        Functions that are called by name.
    operators : mapping
        Function of each operator of Python.
    comparisons : mapping
        Function of each comparison, and whether its operands are exchanged.
    negative : callable
        Makes the expression of a minus sign before anything but a number.
    call : callable
        ``call(parser, name, arguments, depth)`` reads a call.
    usage : str
        What can be written, for messages.
    flat : tuple of operator
        Operators whose chains are one node with several arguments.
    largest_power : int
        Largest exponent of a power that is a product; 0 if a power is a function of two expressions.
    has_names : bool
        Whether there are names and the plus sign.
    too_large : str
        Message for a number that is not finite, which is otherwise like any text that cannot be read.
    """

    functions: Mapping[str, Primitive]
    operators: Mapping[type[ast.operator], Primitive]
    comparisons: Mapping[type[ast.cmpop], tuple[Primitive, bool]]
    negative: Callable[[Expression], Expression]
    call: "Callable[[_Parser, str, Sequence[ast.expr], int], Expression]"
    usage: str
    flat: tuple[type[ast.operator], ...] = ()
    largest_power: int = 0
    has_names: bool = False
    too_large: str = ""


def parse(text: str, primitives: Mapping[str, Primitive] = PRIMITIVES) -> Expression:
    """Parse an expression of lagged signals.

    Parameters
    ----------
    text : str
        Text in the format of `plain`.
    primitives : mapping
        Allowed functions by name.

    Raises
    ------
    ModelError
        The text is not an expression, or it is nested too deeply. The message shows the part that cannot be
        read.
    """
    if not isinstance(text, str):
        raise ModelError(f"an expression is a text such as 'u(k-1)^2', got {text!r}")
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
        return _Parser(replace(MODEL_SYNTAX, functions=primitives)).read(tree.body, -1)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ModelError(f"cannot read {text[:80]!r}: write it like u(k-1)*sign(u(k-1) - u(k-2))") from error


def parse_signals(text: str, signals: Sequence[str]) -> Expression:
    """Parse an expression of lagged signals and parameters by their names: ``pole*x1(k-1) + gain*u(k-1)``.

    Parameters
    ----------
    text : str
        As of `parse`; every name without a lag is a parameter.
    signals : sequence of str
        Names of the signals in the order of the channels.

    Raises
    ------
    ModelError
        The text is not an expression.
    """

    def call(parser: _Parser, name: str, arguments: Sequence[ast.expr], depth: int) -> Expression:
        if name in signals and len(arguments) == 1:
            return Lagged(signals.index(name), _lag(arguments[0]))
        return _call_in_model(parser, name, arguments, depth)

    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
        return _Parser(replace(MODEL_SYNTAX, call=call, has_names=True)).read(tree.body, -1)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ModelError(f"cannot read {text[:80]!r}: write it like pole*x1(k-1) + gain*u(k-1)") from error


def parse_expression(text: str, place: str = "") -> Expression:
    """Parse an expression of names, as in an equation.

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
        tree = ast.parse(text.strip(), mode="eval")
        return _Parser(EQUATION_SYNTAX, f"{place}: ").read(tree.body, MAX_DEPTH)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        detail = f": {error.msg}" if isinstance(error, SyntaxError) else ""
        raise ModelError(f"{place}: this is not an expression such as (F - c*v - k*x)/m{detail}") from error


def parse_formula(text: str) -> Expression:
    """Parse an expression of names, in which functions may have any name, for printing only.

    Raises
    ------
    ModelError
        The text is not an expression.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval")
        return _Parser(replace(EQUATION_SYNTAX, call=_call_by_name), f"{text!r}: ").read(tree.body, MAX_DEPTH)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ModelError(f"{text!r}: this is not an expression such as clip(x, -L, L)") from error


@dataclass(frozen=True, slots=True)
class _Parser:
    """Reader of Python's syntax tree; ``place`` begins its messages."""

    syntax: Syntax
    place: str = ""

    def read(self, node: ast.expr, depth: int) -> Expression:
        """Read a node; ``depth`` is the number of levels that are left, negative for no limit."""
        syntax = self.syntax
        if depth == 0:
            raise ModelError(f"{self.place}nested too deeply: introduce a variable for a part of it")
        below = depth - 1
        match node:
            case ast.Constant(value=entry) if (number := self._number(entry)) is not None:
                return Constant(number)
            case ast.Name(id=name) if syntax.has_names:
                return Constant(CONSTANTS[name]) if name in CONSTANTS else Symbol(name)
            case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=entry)) if (
                number := self._number(entry)
            ) is not None:
                return Constant(-number)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return syntax.negative(self.read(operand, below))
            case ast.UnaryOp(op=ast.UAdd(), operand=operand) if syntax.has_names:
                return self.read(operand, below)
            case ast.BinOp(op=ast.Pow()) if syntax.largest_power:
                factors = self._factors(node, below)
                return Apply(MUL, factors) if len(factors) > 1 else factors[0]
            case ast.BinOp(op=ast.Mult()) if ast.Mult in syntax.flat:
                chain = _chain(node, ast.Mult)
                return Apply(MUL, tuple(each for part in chain for each in self._factors(part, below)))
            case ast.BinOp(op=operator) if type(operator) in syntax.flat:
                chain = _chain(node, type(operator))
                return Apply(
                    syntax.operators[type(operator)], tuple(self.read(part, below) for part in chain)
                )
            case ast.BinOp(left=left, op=operator, right=right) if type(operator) in syntax.operators:
                return Apply(
                    syntax.operators[type(operator)], (self.read(left, below), self.read(right, below))
                )
            case ast.Compare(left=left, ops=[comparison], comparators=[right]) if (
                type(comparison) in syntax.comparisons
            ):
                function, is_exchanged = syntax.comparisons[type(comparison)]
                one, other = (right, left) if is_exchanged else (left, right)
                return Apply(function, (self.read(one, below), self.read(other, below)))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return syntax.call(self, name, arguments, below)
        raise ModelError(f"{self.place}cannot read {ast.unparse(node)!r}: {syntax.usage}")

    def _number(self, entry: object) -> float | None:
        """Return a finite number. Return None for anything else, including True."""
        if isinstance(entry, bool) or not isinstance(entry, int | float):
            return None
        try:
            number = float(entry)
        except OverflowError:
            number = math.inf
        if math.isfinite(number):
            return number
        if self.syntax.too_large:
            raise ModelError(f"{self.place}{self.syntax.too_large}")
        return None

    def _factors(self, node: ast.expr, depth: int) -> tuple[Expression, ...]:
        largest = self.syntax.largest_power
        match node:
            case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant(value=int() as power)) if (
                1 <= power <= largest and power is not True
            ):
                return (self.read(base, depth),) * power
            case ast.BinOp(op=ast.Pow()):
                raise ModelError(
                    f"cannot read {ast.unparse(node)!r}: an exponent must be an integer from 1 to {largest}"
                )
        return (self.read(node, depth),)

    def check_arity(self, name: str, count: int) -> None:
        """Raise `ModelError` if a function is called with a wrong number of arguments."""
        arity = self.syntax.functions[name].arity
        if count != arity:
            raise ModelError(f"{self.place}{name} takes {arity} arguments, got {count}")


def _chain(node: ast.expr, operator: type[ast.operator]) -> list[ast.expr]:
    """Return the operands of a * b * c, which Python parses as (a * b) * c."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, operator):
        return [*_chain(node.left, operator), node.right]
    return [node]


def _call_in_model(parser: _Parser, name: str, arguments: Sequence[ast.expr], depth: int) -> Expression:
    """Read a lagged signal, a back-shift, or a function."""
    if (signal := _SIGNAL.fullmatch(name)) and len(arguments) == 1:
        channel = 0 if name == "y" else int(signal[1] or 1)
        return Lagged(channel, _lag(arguments[0]))
    if (shift := _BACK_SHIFT.fullmatch(name)) and len(arguments) == 1:
        return Shift(int(shift[1]), parser.read(arguments[0], depth))
    primitives = parser.syntax.functions
    if name not in primitives:
        raise ModelError(
            f"unknown function {name!r}: take one of {', '.join(primitives)}, or pass your own primitive in "
            f"primitives=islands.PRIMITIVES | {{{name!r}: ...}}{suggest(name, primitives)}"
        )
    primitive = primitives[name]
    if primitive not in (ADD, MUL) or len(arguments) < primitive.arity:
        parser.check_arity(name, len(arguments))
    return Apply(primitive, tuple(parser.read(argument, depth) for argument in arguments))


def _lag(node: ast.expr) -> int:
    match node:
        case ast.Name(id="k"):
            return 0
        case ast.BinOp(left=ast.Name(id="k"), op=ast.Sub(), right=ast.Constant(value=int() as lag)) if (
            lag is not True
        ):
            return lag
    raise ModelError(f"cannot read the lag {ast.unparse(node)!r}: write k-1, k-2, ...")


def _call_in_equation(parser: _Parser, name: str, nodes: Sequence[ast.expr], depth: int) -> Expression:
    """Read a function, or the rate, the delay or the value by an FMU of a signal."""
    arguments = tuple(parser.read(node, depth) for node in nodes)
    signal_functions = {function.name: function for function in SIGNAL_FUNCTIONS}
    if name in signal_functions:
        match name, arguments:
            case ("rate", (Symbol(),)) | ("delay", (Symbol(), Symbol() | Constant())):
                return Apply(signal_functions[name], arguments)
        raise ModelError(
            f"{parser.place}write rate(F) and delay(F, tau) with the name of the input or of a channel; "
            "tau is a parameter or a number, in seconds"
        )
    match arguments:
        case (Symbol(),) if name == FMU.name:
            return Apply(FMU, arguments)
    if name not in parser.syntax.functions:
        raise ModelError(
            f"{parser.place}unknown function {name!r}: take one of {', '.join(NAMED_FUNCTIONS)}"
            f"{suggest(name, NAMED_FUNCTIONS)}"
        )
    function = parser.syntax.functions[name]
    if name in ("min", "max"):
        while len(arguments) > function.arity:
            first, second, *others = arguments
            arguments = (Apply(function, (first, second)), *others)
    parser.check_arity(name, len(arguments))
    return Apply(function, arguments)


def _call_by_name(parser: _Parser, name: str, nodes: Sequence[ast.expr], depth: int) -> Expression:
    """Read a function of any name."""
    return Apply(name_function(name), tuple(parser.read(node, depth) for node in nodes))


#: Syntax of regressors: ``2*u(k-1)^2/(1 + abs(y(k-1)))``.
MODEL_SYNTAX = Syntax(
    functions=PRIMITIVES,
    operators=MappingProxyType({ast.Add: ADD, ast.Sub: SUB, ast.Mult: MUL, ast.Div: PRIMITIVES["div"]}),
    comparisons=MappingProxyType({}),
    negative=lambda operand: Apply(MUL, (Constant(-1.0), operand)),
    call=_call_in_model,
    usage="use leaves y(k-1) and u(k-1), operators + - * / ^ and functions",
    flat=(ast.Add, ast.Mult),
    largest_power=LARGEST_POWER,
)

#: Syntax of equations: ``where(x > 0, F/m, -k*x**2)``.
EQUATION_SYNTAX = Syntax(
    functions=MappingProxyType({name: EQUATION_FUNCTIONS[name] for name in NAMED_FUNCTIONS}),
    operators=MappingProxyType({ast.Add: ADD, ast.Sub: SUB, ast.Mult: MUL, ast.Div: DIV, ast.Pow: POW}),
    comparisons=MappingProxyType(
        {
            ast.Lt: (LESS, False),
            ast.LtE: (LESS_EQUAL, False),
            ast.Gt: (LESS, True),
            ast.GtE: (LESS_EQUAL, True),
        }
    ),
    negative=lambda operand: Apply(NEG, (operand,)),
    call=_call_in_equation,
    usage="use numbers, names, + - * / **, one comparison with < <= > >=, and the functions "
    f"{', '.join([*NAMED_FUNCTIONS, *(function.name for function in SIGNAL_FUNCTIONS)])}",
    has_names=True,
    too_large="a number is too large",
)
