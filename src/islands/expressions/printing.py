"""Rendering of expressions as plain text, LaTeX and MathML.

Plain text has the form ``u(k-1)*sign(u(k-1) - u(k-2))``: infix operators ``+ - * / ^``, primitives by name,
leaves ``y(k-1)``, ``u(k-1)`` (``u1(k-1)``, ``u2(k-1)`` .. if there are several inputs) and back-shifts
``q2(...)``. `islands.expressions.parsing` parses it.
"""

from collections.abc import Iterator, Sequence
from html import escape
from itertools import groupby

from islands.expressions.primitives import ADD, MUL, SUB
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Primitive, Shift

#: Largest exponent in text. A larger power is written as a product of powers. The limit prevents untrusted
#: text from creating millions of factors.
LARGEST_POWER = 99

# Precedence of the rendered text: a sum needs brackets inside a product, a product inside a power.

#: Precedence of a sum or a negative number.
_SUM = 0

#: Precedence of a product.
_PRODUCT = 1

#: Precedence of a leaf, a call or a bracketed expression.
_ATOM = 2


def plain(expression: Expression, inputs: int = 1) -> str:
    """Write an expression as plain text that `parse` converts back to the same expression."""
    return _plain(expression, inputs)[0]


def _plain(expression: Expression, inputs: int) -> tuple[str, int]:
    match expression:
        case Lagged(channel, lag):
            return f"{_name(channel, inputs)}(k-{lag})" if lag else f"{_name(channel, inputs)}(k)", _ATOM
        case Constant(number):
            return _digits(number), _number_precedence(number)
        case Shift(samples, argument):
            return f"q{samples}({plain(argument, inputs)})", _ATOM
        case Apply(primitive, (_, _, *_) as arguments) if primitive in (ADD, SUB):
            # A sum inside a sum is written as a call, because infix would be parsed as one flat sum.
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
            parts.append(plain_factor(factor, inputs, (MUL,)))
        else:
            parts.append(f"{_operand(factor, inputs, _ATOM, (MUL,))}^{power}")
    return "*".join(parts)


def plain_factor(expression: Expression, inputs: int, as_call: tuple[Primitive, ...] = ()) -> str:
    """Write an expression as a factor of a product, in brackets if necessary."""
    # A quotient has the precedence of a product, and a*b/c is parsed as (a*b)/c.
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


def _number_precedence(number: float) -> int:
    # Minus zero has a sign as well: -0^2 would be parsed as -(0^2).
    return _SUM if _digits(number).startswith("-") else _ATOM


def _operand(expression: Expression, inputs: int, minimum: int, as_call: tuple[Primitive, ...] = ()) -> str:
    if isinstance(expression, Apply) and expression.primitive in as_call:
        return _call(expression.primitive, expression.arguments, inputs)
    text, precedence = _plain(expression, inputs)
    return text if precedence >= minimum else f"({text})"


def _call(primitive: Primitive, arguments: Sequence[Expression], inputs: int) -> str:
    return f"{primitive.name}({', '.join(plain(argument, inputs) for argument in arguments)})"


def _name(channel: int, inputs: int) -> str:
    if channel == 0:
        return "y"
    return "u" if inputs == 1 and channel == 1 else f"u{channel}"


def at_rest(expression: Expression, inputs: int = 1) -> str:
    """Write a steady state (leaves of lag 0): ``y*u`` for ybar ubar, ``1`` for a constant."""
    return plain(expression, inputs).replace("(k)", "")


def latex(expression: Expression, inputs: int = 1) -> str:
    """Write an expression in LaTeX without dollar signs."""
    return _latex(expression, inputs)[0]


def _latex(expression: Expression, inputs: int) -> tuple[str, int]:
    match expression:
        case Lagged(channel, lag):
            name = _name(channel, inputs)
            index = f"{name[1:]}," if len(name) > 1 else ""
            return f"{name[0]}_{{{index}k{f'-{lag}' if lag else ''}}}", _ATOM
        case Constant(number):
            return latex_number(_digits(number)), _number_precedence(number)
        case Shift(samples, argument):
            return f"q^{{-{samples}}} {_latex_operand(argument, inputs, _ATOM)}", _PRODUCT
        case Apply(primitive, arguments) if primitive in (ADD, SUB):
            parts = [_latex_operand(argument, inputs, _PRODUCT) for argument in arguments]
            return (" + " if primitive == ADD else " - ").join(parts), _SUM
        case Apply(primitive, arguments) if primitive == MUL:
            return " ".join(_latex_powers(arguments, inputs)), _PRODUCT
        case Apply(primitive, arguments):
            return primitive.latex.format(*(latex(argument, inputs) for argument in arguments)), _ATOM


def _latex_powers(factors: Sequence[Expression], inputs: int) -> list[str]:
    parts: list[str] = []
    for factor, run in groupby(factors):
        power = len(list(run))
        text = _latex_operand(factor, inputs, _ATOM)
        # Brackets separate an exponent from an exponent or a fraction, and a number from a preceding factor.
        bare = text[0] != "\\" or text[-1] == "}"
        if (power > 1 and bare and not isinstance(factor, Lagged)) or (
            parts and isinstance(factor, Constant)
        ):
            text = rf"\left({text}\right)"
        parts.append(text if power == 1 else f"{text}^{{{power}}}")
    return parts


def _latex_operand(expression: Expression, inputs: int, minimum: int) -> str:
    text, precedence = _latex(expression, inputs)
    return text if precedence >= minimum else rf"\left({text}\right)"


def latex_factor(expression: Expression, inputs: int) -> str:
    """Write an expression in LaTeX as a factor of a product, in brackets if necessary."""
    return _latex_operand(expression, inputs, _PRODUCT)


def latex_number(number: str) -> str:
    """Convert a number from Python's notation to LaTeX."""
    mantissa, _, exponent = number.partition("e")
    return mantissa if not exponent else rf"{mantissa} \times 10^{{{int(exponent)}}}"


#: Minus sign (U+2212).
MINUS = "<mo>&#x2212;</mo>"

#: Invisible product sign (U+2062) with a thin space, which separates a parameter from a function name.
TIMES = '<mo rspace="0.17em">&#x2062;</mo>'

#: Function application (U+2061).
_APPLY = "<mo>&#x2061;</mo>"

#: Format string of an absolute value.
_ABSOLUTE = "<mrow><mo>|</mo>{0}<mo>|</mo></mrow>"

#: Format strings of functions that are not written by name. They need brackets below an exponent.
_MATHML = {
    "div": "<mfrac>{0}{1}</mfrac>",
    "log": f"<mrow><mi>ln</mi>{_APPLY}{_ABSOLUTE}</mrow>",
    "sqrt": f"<msqrt>{_ABSOLUTE}</msqrt>",
}


def mathml(expression: Expression, inputs: int = 1) -> str:
    """Write an expression as one element of presentation MathML, in ASCII."""
    return _mathml(expression, inputs)[0]


def _mathml(expression: Expression, inputs: int) -> tuple[str, int]:
    match expression:
        case Lagged(channel, lag):
            name = _name(channel, inputs)
            index = f"<mn>{name[1:]}</mn><mo>,</mo>" if len(name) > 1 else ""
            past = f"{MINUS}<mn>{lag}</mn>" if lag else ""
            return f"<msub><mi>{name[0]}</mi><mrow>{index}<mi>k</mi>{past}</mrow></msub>", _ATOM
        case Constant(number):
            return mathml_number(_digits(number)), _number_precedence(number)
        case Shift(samples, argument):
            shift = f"<msup><mi>q</mi><mrow>{MINUS}<mn>{samples}</mn></mrow></msup>"
            return f"<mrow>{shift}{TIMES}{_mathml_operand(argument, inputs, _ATOM)}</mrow>", _PRODUCT
        case Apply(primitive, arguments) if primitive in (ADD, SUB):
            parts = [_mathml_operand(argument, inputs, _PRODUCT) for argument in arguments]
            return f"<mrow>{('<mo>+</mo>' if primitive == ADD else MINUS).join(parts)}</mrow>", _SUM
        case Apply(primitive, arguments) if primitive == MUL:
            return f"<mrow>{TIMES.join(_mathml_powers(arguments, inputs))}</mrow>", _PRODUCT
        case Apply(primitive, arguments):
            return _mathml_call(primitive.name, [mathml(argument, inputs) for argument in arguments]), _ATOM


def _mathml_powers(factors: Sequence[Expression], inputs: int) -> list[str]:
    parts: list[str] = []
    for factor, run in groupby(factors):
        power = len(list(run))
        text, precedence = _mathml(factor, inputs)
        # As in LaTeX, brackets separate an exponent from a number or a fraction, and a number from a
        # preceding factor.
        tall = isinstance(factor, Apply) and factor.primitive.name in _MATHML and power > 1
        if precedence < _ATOM or tall or (isinstance(factor, Constant) and (power > 1 or parts)):
            text = _mathml_brackets(text)
        parts.append(text if power == 1 else f"<msup>{text}<mn>{power}</mn></msup>")
    return parts


def _mathml_call(name: str, arguments: Sequence[str]) -> str:
    if name == "abs":
        return _ABSOLUTE.format(*arguments)
    if name in _MATHML:
        return _MATHML[name].format(*arguments)
    safe = escape(name).encode("ascii", "xmlcharrefreplace").decode()
    return f"<mrow><mi>{safe}</mi>{_APPLY}{_mathml_brackets('<mo>,</mo>'.join(arguments))}</mrow>"


def _mathml_brackets(text: str) -> str:
    return f"<mrow><mo>(</mo>{text}<mo>)</mo></mrow>"


def _mathml_operand(expression: Expression, inputs: int, minimum: int) -> str:
    text, precedence = _mathml(expression, inputs)
    return text if precedence >= minimum else _mathml_brackets(text)


def mathml_factor(expression: Expression, inputs: int) -> str:
    """Write an expression in MathML as a factor of a product, in brackets if necessary."""
    return _mathml_operand(expression, inputs, _PRODUCT)


def mathml_number(number: str) -> str:
    """Convert a number from Python's notation to MathML."""
    mantissa, _, exponent = number.removeprefix("-").partition("e")
    sign = MINUS if number.startswith("-") else ""
    power = f"<mo>&#xD7;</mo><msup><mn>10</mn>{mathml_number(str(int(exponent)))}</msup>" if exponent else ""
    return f"<mrow>{sign}<mn>{mantissa}</mn>{power}</mrow>" if sign or power else f"<mn>{mantissa}</mn>"
