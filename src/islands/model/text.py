"""Expressions and equations as text: plain text that can be read back, and LaTeX.

Plain text is ``u(k-1)*sign(u(k-1) - u(k-2))``: infix ``+ - * / ^`` and the primitives by name, with the
leaves ``y(k-1)``, ``u(k-1)`` (``u1(k-1)``, ``u2(k-1)`` .. where there are several inputs) and back-shifts
``q2(...)``. It is a subset of Python's own syntax but for the caret, so Python's parser reads it.
"""

import ast
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

from islands.errors import ModelError
from islands.model.expression import Apply, Constant, Expression, Lagged, Primitive, Shift
from islands.model.model import Model
from islands.model.primitives import ADD, MUL, PRIMITIVES, SUB

_SIGNAL = re.compile(r"y|u([1-9][0-9]*)?")
_BACK_SHIFT = re.compile(r"q([0-9]+)")
_OPERATORS: Mapping[type[ast.operator], str] = {
    ast.Add: "add",
    ast.Sub: "sub",
    ast.Mult: "mul",
    ast.Div: "div",
}

#: A larger power is written as a product of powers: text from outside must not ask for millions of factors.
LARGEST_POWER = 99

#: How tightly text holds together: a sum is put in brackets inside a product, a product inside a power.
_SUM, _PRODUCT, _ATOM = 0, 1, 2


def plain(expression: Expression, inputs: int = 1) -> str:
    """Write an expression so that `parse` reads the same expression back."""
    return _plain(expression, inputs)[0]


def _plain(expression: Expression, inputs: int) -> tuple[str, int]:
    match expression:
        case Lagged(channel, lag):
            return f"{_name(channel, inputs)}(k-{lag})" if lag else f"{_name(channel, inputs)}(k)", _ATOM
        case Constant(number):
            return _digits(number), _binding(number)
        case Shift(samples, argument):
            return f"q{samples}({plain(argument, inputs)})", _ATOM
        case Apply(primitive, (_, _, *_) as arguments) if primitive in (ADD, SUB):
            # A sum inside a sum is written as a call: infix would be read back as one flat sum.
            parts = [_operand(argument, inputs, _PRODUCT, (ADD, SUB)) for argument in arguments]
            return (" + " if primitive == ADD else " - ").join(parts), _SUM
        case Apply(primitive, (_, _, *_) as arguments) if primitive == MUL:
            return _plain_product(arguments, inputs), _PRODUCT
        case Apply(primitive, (first, second)) if primitive.name == "div":
            return f"{_operand(first, inputs, _ATOM)}/{_operand(second, inputs, _ATOM)}", _PRODUCT
        case Apply(primitive, arguments):
            return _call(primitive, arguments, inputs), _ATOM


def _plain_product(factors: Sequence[Expression], inputs: int) -> str:
    parts = []
    for factor, power in _powers(factors):
        if power == 1:
            parts.append(_plain_factor(factor, inputs, (MUL,)))
        else:
            parts.append(f"{_operand(factor, inputs, _ATOM, (MUL,))}^{power}")
    return "*".join(parts)


def _plain_factor(expression: Expression, inputs: int, as_call: tuple[Primitive, ...] = ()) -> str:
    # A quotient binds like a product, and a*b/c is read as (a*b)/c.
    text = _operand(expression, inputs, _PRODUCT, as_call)
    return f"({text})" if isinstance(expression, Apply) and expression.primitive.name == "div" else text


def _powers(factors: Sequence[Expression]) -> Iterator[tuple[Expression, int]]:
    for factor, run in groupby(factors):
        left = len(list(run))
        while left:
            yield factor, min(left, LARGEST_POWER)
            left -= min(left, LARGEST_POWER)


def _digits(number: float) -> str:
    return repr(float(number)).removesuffix(".0")


def _binding(number: float) -> int:
    # Minus zero has a sign, too: -0^2 would be read as -(0^2).
    return _SUM if _digits(number).startswith("-") else _ATOM


def _operand(expression: Expression, inputs: int, binding: int, as_call: tuple[Primitive, ...] = ()) -> str:
    if isinstance(expression, Apply) and expression.primitive in as_call:
        return _call(expression.primitive, expression.arguments, inputs)
    text, own = _plain(expression, inputs)
    return text if own >= binding else f"({text})"


def _call(primitive: Primitive, arguments: Sequence[Expression], inputs: int) -> str:
    return f"{primitive.name}({', '.join(plain(argument, inputs) for argument in arguments)})"


def _name(channel: int, inputs: int) -> str:
    if channel == 0:
        return "y"
    return "u" if inputs == 1 and channel == 1 else f"u{channel}"


def at_rest(expression: Expression, inputs: int = 1) -> str:
    """Write a steady state, whose leaves have lag 0: ``y*u`` for ybar ubar, ``1`` for a constant."""
    return plain(expression, inputs).replace("(k)", "")


def latex(expression: Expression, inputs: int = 1) -> str:
    """Write an expression in LaTeX's mathematics, without dollars."""
    return _latex(expression, inputs)[0]


def _latex(expression: Expression, inputs: int) -> tuple[str, int]:
    match expression:
        case Lagged(channel, lag):
            name = _name(channel, inputs)
            index = f"{name[1:]}," if len(name) > 1 else ""
            return f"{name[0]}_{{{index}k{f'-{lag}' if lag else ''}}}", _ATOM
        case Constant(number):
            return _latex_number(_digits(number)), _binding(number)
        case Shift(samples, argument):
            return f"q^{{-{samples}}} {_bracketed(argument, inputs, _ATOM)}", _PRODUCT
        case Apply(primitive, arguments) if primitive in (ADD, SUB):
            parts = [_bracketed(argument, inputs, _PRODUCT) for argument in arguments]
            return (" + " if primitive == ADD else " - ").join(parts), _SUM
        case Apply(primitive, arguments) if primitive == MUL:
            return " ".join(_latex_powers(arguments, inputs)), _PRODUCT
        case Apply(primitive, arguments):
            return primitive.latex.format(*(latex(argument, inputs) for argument in arguments)), _ATOM


def _latex_powers(factors: Sequence[Expression], inputs: int) -> list[str]:
    parts: list[str] = []
    for factor, run in groupby(factors):
        power = len(list(run))
        text = _bracketed(factor, inputs, _ATOM)
        # No exponent stands on an exponent or a fraction, and no number directly behind another one.
        bare = text[0] != "\\" or text[-1] == "}"
        if (power > 1 and bare and not isinstance(factor, Lagged)) or (
            parts and isinstance(factor, Constant)
        ):
            text = rf"\left({text}\right)"
        parts.append(text if power == 1 else f"{text}^{{{power}}}")
    return parts


def _bracketed(expression: Expression, inputs: int, binding: int) -> str:
    text, own = _latex(expression, inputs)
    return text if own >= binding else rf"\left({text}\right)"


def _latex_number(number: str) -> str:
    mantissa, _, exponent = number.partition("e")
    return mantissa if not exponent else rf"{mantissa} \times 10^{{{int(exponent)}}}"


def equation(model: Model, digits: int = 6) -> str:
    """Write a model as one line: ``y(k) = 1*y(k-1) + 0.77*(u(k-1) - u(k-2))``.

    The parameters are rounded to ``digits`` significant digits; a model without parameters shows theta1 ...
    """
    parts = []
    for position, item in enumerate(model.regressors):
        weight = f"theta{position + 1}" if model.theta is None else f"{model.theta[position]:.{digits}g}"
        constant = item.expression == Constant(1.0)
        parts.append(weight if constant else f"{weight}*{_plain_factor(item.expression, model.inputs)}")
    return f"y(k) = {_joined(parts)}"


def latex_equation(model: Model, digits: int = 6) -> str:
    """Write a model as one line of LaTeX, without dollars."""
    parts = []
    for position, item in enumerate(model.regressors):
        weight = (
            rf"\theta_{{{position + 1}}}"
            if model.theta is None
            else _latex_number(f"{model.theta[position]:.{digits}g}")
        )
        constant = item.expression == Constant(1.0)
        parts.append(
            weight if constant else rf"{weight} \, {_bracketed(item.expression, model.inputs, _PRODUCT)}"
        )
    return f"y_{{k}} = {_joined(parts)}"


def _joined(terms: Sequence[str]) -> str:
    return " + ".join(terms).replace("+ -", "- ")


def parse(text: str, primitives: Mapping[str, Primitive] = PRIMITIVES) -> Expression:
    """Read an expression.

    Parameters
    ----------
    text : str
        As `plain` writes it.
    primitives : mapping
        The functions that may stand in it, by name.

    Raises
    ------
    ModelError
        It is no expression, or nested too deeply: the message shows the part that could not be read.
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
        f"cannot read {ast.unparse(node)!r}: a leaf is y(k-1) or u(k-1), the rest + - * / ^ and functions"
    )


def _number(node: ast.Constant) -> float | None:
    """Return a finite number, or None: True is no number, and 1e999 is none either."""
    match node.value:
        case bool():
            return None
        case int() | float() as number if abs(number) <= sys.float_info.max:
            return float(number)
    return None


def _chain(node: ast.expr, operator: type[ast.operator]) -> list[ast.expr]:
    """Return the operands of a * b * c, which Python reads as (a * b) * c."""
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
                f"cannot read {ast.unparse(node)!r}: a power is a whole number from 1 to {LARGEST_POWER}"
            )
    return (_read(node, primitives),)


def _read_call(name: str, arguments: Sequence[ast.expr], primitives: Mapping[str, Primitive]) -> Expression:
    if (signal := _SIGNAL.fullmatch(name)) and len(arguments) == 1:
        channel = 0 if name == "y" else int(signal[1] or 1)
        return Lagged(channel, _lag(arguments[0]))
    if (shift := _BACK_SHIFT.fullmatch(name)) and len(arguments) == 1:
        return Shift(int(shift[1]), _read(arguments[0], primitives))
    if name not in primitives:
        raise ModelError(f"unknown function {name!r}: known are {', '.join(primitives)}")
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
