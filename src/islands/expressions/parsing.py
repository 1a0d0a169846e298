"""Parser of expressions in plain text.

Except for the caret, the syntax is a subset of Python's, so Python's parser is used.
"""

import ast
import re
import sys
from collections.abc import Mapping, Sequence

from islands.errors import ModelError, suggest
from islands.expressions.primitives import ADD, MUL, PRIMITIVES
from islands.expressions.printing import LARGEST_POWER
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Primitive, Shift

_SIGNAL = re.compile(r"y|u([1-9][0-9]*)?")
_BACK_SHIFT = re.compile(r"q([0-9]+)")
_OPERATORS: Mapping[type[ast.operator], str] = {
    ast.Add: "add",
    ast.Sub: "sub",
    ast.Mult: "mul",
    ast.Div: "div",
}


def parse(text: str, primitives: Mapping[str, Primitive] = PRIMITIVES) -> Expression:
    """Parse an expression.

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
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
        return _read(tree.body, primitives)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ModelError(f"cannot read {text[:80]!r}: write it like u(k-1)*sign(u(k-1) - u(k-2))") from error


def _read(node: ast.expr, primitives: Mapping[str, Primitive]) -> Expression:
    match node:
        case ast.Constant() if (number := _number(node)) is not None:
            return Constant(number)
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant() as operand) if (
            number := _number(operand)
        ) is not None:
            return Constant(-number)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return Apply(MUL, (Constant(-1.0), _read(operand, primitives)))
        case ast.BinOp(op=ast.Pow()):
            factors = _factors(node, primitives)
            return Apply(MUL, factors) if len(factors) > 1 else factors[0]
        case ast.BinOp(op=ast.Mult()):
            return Apply(MUL, tuple(f for part in _chain(node, ast.Mult) for f in _factors(part, primitives)))
        case ast.BinOp(op=ast.Add()):
            return Apply(ADD, tuple(_read(part, primitives) for part in _chain(node, ast.Add)))
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
            return Apply(
                PRIMITIVES[_OPERATORS[type(operator)]], (_read(left, primitives), _read(right, primitives))
            )
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _read_call(name, arguments, primitives)
    raise ModelError(
        f"cannot read {ast.unparse(node)!r}: use leaves y(k-1) and u(k-1), operators + - * / ^ and functions"
    )


def _number(node: ast.Constant) -> float | None:
    """Return a finite number. Return None for anything else, including True and 1e999."""
    match node.value:
        case bool():
            return None
        case int() | float() as number if abs(number) <= sys.float_info.max:
            return float(number)
    return None


def _chain(node: ast.expr, operator: type[ast.operator]) -> list[ast.expr]:
    """Return the operands of a * b * c, which Python parses as (a * b) * c."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, operator):
        return [*_chain(node.left, operator), node.right]
    return [node]


def _factors(node: ast.expr, primitives: Mapping[str, Primitive]) -> tuple[Expression, ...]:
    match node:
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant(value=int() as power)) if (
            1 <= power <= LARGEST_POWER and power is not True
        ):
            return (_read(base, primitives),) * power
        case ast.BinOp(op=ast.Pow()):
            raise ModelError(
                f"cannot read {ast.unparse(node)!r}: an exponent must be an integer from 1 to {LARGEST_POWER}"
            )
    return (_read(node, primitives),)


def _read_call(name: str, arguments: Sequence[ast.expr], primitives: Mapping[str, Primitive]) -> Expression:
    if (signal := _SIGNAL.fullmatch(name)) and len(arguments) == 1:
        channel = 0 if name == "y" else int(signal[1] or 1)
        return Lagged(channel, _lag(arguments[0]))
    if (shift := _BACK_SHIFT.fullmatch(name)) and len(arguments) == 1:
        return Shift(int(shift[1]), _read(arguments[0], primitives))
    if name not in primitives:
        raise ModelError(
            f"unknown function {name!r}: take one of {', '.join(primitives)}, or pass your own primitive in "
            f"primitives=islands.PRIMITIVES | {{{name!r}: ...}}{suggest(name, primitives)}"
        )
    primitive = primitives[name]
    variadic = primitive in (ADD, MUL) and len(arguments) > 1
    if len(arguments) != primitive.arity and not variadic:
        raise ModelError(f"{name} takes {primitive.arity} arguments, got {len(arguments)}")
    return Apply(primitive, tuple(_read(argument, primitives) for argument in arguments))


def _lag(node: ast.expr) -> int:
    match node:
        case ast.Name(id="k"):
            return 0
        case ast.BinOp(left=ast.Name(id="k"), op=ast.Sub(), right=ast.Constant(value=int() as lag)) if (
            lag is not True
        ):
            return lag
    raise ModelError(f"cannot read the lag {ast.unparse(node)!r}: write k-1, k-2, ...")
