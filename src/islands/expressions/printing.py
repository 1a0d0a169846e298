"""Printers of expressions: plain text of models and of equations, LaTeX, MathML, and programs.

Plain text of a model has the form ``u(k-1)*sign(u(k-1) - u(k-2))``: infix operators ``+ - * / ^``,
primitives by name, leaves ``y(k-1)``, ``u(k-1)`` (``u1(k-1)``, ``u2(k-1)`` .. if there are several inputs)
and back-shifts ``q2(...)``. That of an equation has the form ``(F - c*v)/m - x**2``.
`islands.expressions.parsing` parses both. A printer is a table of operators, and writes leaves and calls.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from html import escape
from itertools import groupby
from math import copysign, pi
from typing import ClassVar, NamedTuple

from islands.errors import ModelError
from islands.expressions.primitives import LARGEST_EXPONENT, NEG
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Primitive, Shift, Symbol

#: Largest exponent in text. A larger power is written as a product of powers. The limit prevents untrusted
#: text from creating millions of factors.
LARGEST_POWER = 99

#: Precedences of text. An operand with a lower precedence than its operator requires is in brackets. In a
#: model, a quotient is less than a product, because ``a*b/c`` is parsed as ``(a*b)/c``.
COMPARISON, SUM, QUOTIENT, PRODUCT, SIGN, POWER, ATOM = range(7)

#: Function with its argument in square brackets: the simulation of a signal as a whole.
SIMULATION = "G"


class Operator(NamedTuple):
    """Infix form of a function.

    Attributes
    ----------
    text : str
    own : int
        Precedence of the result.
    first, others : int
        Least precedence of the first operand and of the others without brackets.
    """

    text: str
    own: int
    first: int
    others: int


#: Operators of an equation. A sign binds less than a power on its left, and more than one on its right.
EQUATION_OPERATORS: Mapping[str, Operator] = {
    "less": Operator(" < ", COMPARISON, SUM, SUM),
    "less_equal": Operator(" <= ", COMPARISON, SUM, SUM),
    "add": Operator(" + ", SUM, SUM, PRODUCT),
    "sub": Operator(" - ", SUM, SUM, PRODUCT),
    "mul": Operator("*", PRODUCT, PRODUCT, SIGN),
    "div": Operator("/", PRODUCT, PRODUCT, SIGN),
    "pow": Operator("**", POWER, ATOM, SIGN),
}

#: Operators of a model in a program. All languages evaluate equal operators from left to right, as `value`
#: does. Each operation is in brackets: they keep that order when a parameter multiplies the result, and the
#: kernels multiply by it last.
BRACKETED_OPERATORS: Mapping[str, Operator] = {
    "mul": Operator("*", SUM, ATOM, ATOM),
    "add": Operator(" + ", SUM, ATOM, ATOM),
    "sub": Operator(" - ", SUM, ATOM, ATOM),
}


class Printer:
    """Printer of the text of an equation, and base of the others."""

    #: Functions that are written between their operands.
    operators: Mapping[str, Operator] = EQUATION_OPERATORS

    #: Precedence of a negative number, also of minus zero: ``-0**2`` would be parsed as ``-(0**2)``.
    negative: ClassVar[int] = SIGN

    #: Format string of brackets.
    brackets: ClassVar[str] = "({})"

    #: Sign of a negative expression.
    minus: ClassVar[str] = "-"

    def write(self, expression: Expression) -> str:
        """Write an expression."""
        return self._write(expression)[0]

    def write_operand(self, expression: Expression, least: int) -> str:
        """Write an expression, in brackets if its precedence is lower than ``least``."""
        text, precedence = self._write(expression)
        return text if precedence >= least else self.brackets.format(text)

    def _write(self, expression: Expression) -> tuple[str, int]:
        match expression:
            case Lagged(channel, lag):
                return self.signal(channel, lag), ATOM
            case Symbol(name):
                return self.symbol(name), ATOM
            case Constant(number):
                return self.number(number), self.negative if copysign(1.0, number) < 0.0 else ATOM
            case Shift(samples, argument):
                return self.shift(samples, argument)
            case Apply(Primitive("neg", is_protected=False), (Constant(number),)):
                return self._write(Constant(-number))
            case Apply(Primitive("neg", is_protected=False), (operand,)):
                return f"-{self.write_operand(operand, SIGN)}", SIGN
            case Apply(primitive, (_, _, *_) as arguments) if primitive.name in self.operators:
                operator = self.operators[primitive.name]
                return self.join(operator, arguments), operator.own
            case Apply(primitive, arguments):
                return self.call(primitive, [self.write(argument) for argument in arguments]), ATOM

    def signal(self, channel: int, lag: int) -> str:
        """Write a lagged signal."""
        raise ModelError(f"{Lagged(channel, lag)!r} cannot be written in an equation")

    def symbol(self, name: str) -> str:
        """Write a name."""
        return name

    def number(self, number: float) -> str:
        """Write a constant."""
        return _digits(number)

    def shift(self, samples: int, argument: Expression) -> tuple[str, int]:
        """Write a back-shift; return its precedence too."""
        raise ModelError(
            f"{Shift(samples, argument)!r} is not in canonical form: bring it there with `regressor`"
        )

    def join(self, operator: Operator, arguments: Sequence[Expression]) -> str:
        """Write an operator between its operands."""
        least = [operator.first, *[operator.others] * (len(arguments) - 1)]
        return operator.text.join(map(self.write_operand, arguments, least))

    def call(self, primitive: Primitive, arguments: Sequence[str]) -> str:
        """Write a function of arguments that are written."""
        return f"{primitive.name}({', '.join(arguments)})"


class ProgramPrinter(Printer):
    """Printer of expressions in a programming language.

    Parameters
    ----------
    operators : mapping
    call : callable
        ``call(primitive, arguments)`` returns the text of a function of written arguments.
    signal : callable, optional
        ``signal(channel, lag)`` returns the text of a sample.
    symbol : callable
        Returns the text of a name.
    """

    def __init__(
        self,
        operators: Mapping[str, Operator],
        call: Callable[[Primitive, Sequence[str]], str],
        signal: Callable[[int, int], str] | None = None,
        symbol: Callable[[str], str] = str,
    ) -> None:
        self.operators = operators
        self._call, self._signal, self._symbol = call, signal, symbol

    def signal(self, channel: int, lag: int) -> str:
        """Write a sample."""
        return super().signal(channel, lag) if self._signal is None else self._signal(channel, lag)

    def symbol(self, name: str) -> str:
        """Write a name."""
        return self._symbol(name)

    def number(self, number: float) -> str:
        """Write a constant as a number with a decimal point."""
        return repr(float(number))

    def call(self, primitive: Primitive, arguments: Sequence[str]) -> str:
        """Write a function of arguments that are written."""
        return self._call(primitive, arguments)


class _ModelPrinter(Printer):
    """Printer of lagged signals; with one input, its name is u."""

    negative = SUM

    def __init__(self, has_one_input: bool) -> None:
        self._has_one_input = has_one_input

    def name(self, channel: int) -> str:
        if channel == 0:
            return "y"
        return "u" if self._has_one_input and channel == 1 else f"u{channel}"


class _PlainPrinter(_ModelPrinter):
    """Printer of a model as plain text."""

    operators: Mapping[str, Operator] = {
        "add": Operator(" + ", SUM, QUOTIENT, QUOTIENT),
        "sub": Operator(" - ", SUM, QUOTIENT, QUOTIENT),
        "mul": Operator("*", PRODUCT, PRODUCT, PRODUCT),
        "div": Operator("/", QUOTIENT, ATOM, ATOM),
    }

    def signal(self, channel: int, lag: int) -> str:
        return f"{self.name(channel)}(k-{lag})" if lag else f"{self.name(channel)}(k)"

    def shift(self, samples: int, argument: Expression) -> tuple[str, int]:
        return f"q{samples}({self.write(argument)})", ATOM

    def join(self, operator: Operator, arguments: Sequence[Expression]) -> str:
        if operator.own != PRODUCT:
            return operator.text.join(self._write_part(each, operator, 1) for each in arguments)
        return operator.text.join(
            self._write_part(factor, operator, power) for factor, power in _powers(arguments)
        )

    def _write_part(self, operand: Expression, operator: Operator, power: int) -> str:
        match operand:
            case Apply(primitive, arguments) if self._is_flat(primitive, operator):
                text = self.call(primitive, [self.write(each) for each in arguments])
            case _:
                text = self.write_operand(operand, operator.others if power == 1 else ATOM)
        return text if power == 1 else f"{text}^{power}"

    def _is_flat(self, primitive: Primitive, outer: Operator) -> bool:
        # A sum inside a sum is written as a call, because infix would be parsed as one flat sum. So is a
        # product inside a product.
        inner = self.operators.get(primitive.name)
        return inner is not None and inner.own == outer.own != QUOTIENT


class _ReaderPrinter(_PlainPrinter):
    """Printer of a model as text for readers: it states the protection of the functions."""

    operators: Mapping[str, Operator] = {
        name: operator for name, operator in _PlainPrinter.operators.items() if name != "div"
    }

    def call(self, primitive: Primitive, arguments: Sequence[str]) -> str:
        form = primitive.protected_text
        return form.format(*arguments) if form else super().call(primitive, arguments)


def _powers(factors: Sequence[Expression]) -> Iterator[tuple[Expression, int]]:
    for factor, run in groupby(factors):
        left = len(list(run))
        while left:
            yield factor, min(left, LARGEST_POWER)
            left -= min(left, LARGEST_POWER)


class _LatexPrinter(_ModelPrinter):
    """Printer of a model as LaTeX without dollar signs."""

    operators: Mapping[str, Operator] = {
        "add": Operator(" + ", SUM, QUOTIENT, QUOTIENT),
        "sub": Operator(" - ", SUM, QUOTIENT, QUOTIENT),
        "mul": Operator(" ", PRODUCT, ATOM, ATOM),
    }
    brackets = r"\left({}\right)"

    def signal(self, channel: int, lag: int) -> str:
        name = self.name(channel)
        index = f"{name[1:]}," if len(name) > 1 else ""
        return f"{name[0]}_{{{index}k{f'-{lag}' if lag else ''}}}"

    def number(self, number: float) -> str:
        return latex_number(_digits(number))

    def shift(self, samples: int, argument: Expression) -> tuple[str, int]:
        return f"q^{{-{samples}}} {self.write_operand(argument, ATOM)}", PRODUCT

    def join(self, operator: Operator, arguments: Sequence[Expression]) -> str:
        if operator.own != PRODUCT:
            return super().join(operator, arguments)
        parts: list[str] = []
        for factor, run in groupby(arguments):
            power = len(list(run))
            text = self.write_operand(factor, operator.others)
            # Brackets separate an exponent from an exponent or a fraction, and a number from a preceding
            # factor.
            bare = text[0] != "\\" or text[-1] == "}"
            if (power > 1 and bare and not isinstance(factor, Lagged)) or (
                parts and isinstance(factor, Constant)
            ):
                text = self.brackets.format(text)
            parts.append(text if power == 1 else f"{text}^{{{power}}}")
        return operator.text.join(parts)

    def call(self, primitive: Primitive, arguments: Sequence[str]) -> str:
        return primitive.latex.format(*arguments)


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
    "exp": f"<mrow><mi>exp</mi>{_APPLY}<mo>(</mo><mi>min</mi>{_APPLY}<mo>(</mo>{{0}}<mo>,</mo>"
    f"<mn>{LARGEST_EXPONENT:g}</mn><mo>)</mo><mo>)</mo></mrow>",
    "log": f"<mrow><mi>ln</mi>{_APPLY}{_ABSOLUTE}</mrow>",
    "sqrt": f"<msqrt>{_ABSOLUTE}</msqrt>",
}


class _MathmlPrinter(_ModelPrinter):
    """Printer of a model as presentation MathML in ASCII; each expression is one element."""

    operators: Mapping[str, Operator] = {
        "add": Operator("<mo>+</mo>", SUM, QUOTIENT, QUOTIENT),
        "sub": Operator(MINUS, SUM, QUOTIENT, QUOTIENT),
        "mul": Operator(TIMES, PRODUCT, ATOM, ATOM),
    }
    brackets = "<mrow><mo>(</mo>{}<mo>)</mo></mrow>"
    minus = MINUS

    def signal(self, channel: int, lag: int) -> str:
        name = self.name(channel)
        index = f"<mn>{name[1:]}</mn><mo>,</mo>" if len(name) > 1 else ""
        past = f"{MINUS}<mn>{lag}</mn>" if lag else ""
        return f"<msub><mi>{name[0]}</mi><mrow>{index}<mi>k</mi>{past}</mrow></msub>"

    def number(self, number: float) -> str:
        return mathml_number(_digits(number))

    def shift(self, samples: int, argument: Expression) -> tuple[str, int]:
        shift = f"<msup><mi>q</mi><mrow>{MINUS}<mn>{samples}</mn></mrow></msup>"
        return f"<mrow>{shift}{TIMES}{self.write_operand(argument, ATOM)}</mrow>", PRODUCT

    def join(self, operator: Operator, arguments: Sequence[Expression]) -> str:
        if operator.own != PRODUCT:
            return f"<mrow>{super().join(operator, arguments)}</mrow>"
        parts: list[str] = []
        for factor, run in groupby(arguments):
            power = len(list(run))
            # As in LaTeX, brackets separate an exponent from a number or a fraction, and a number from a
            # preceding factor.
            text, precedence = self._write(factor)
            tall = isinstance(factor, Apply) and factor.primitive.name in _MATHML and power > 1
            if precedence < ATOM or tall or (isinstance(factor, Constant) and (power > 1 or parts)):
                text = self.brackets.format(text)
            parts.append(text if power == 1 else f"<msup>{text}<mn>{power}</mn></msup>")
        return f"<mrow>{operator.text.join(parts)}</mrow>"

    def call(self, primitive: Primitive, arguments: Sequence[str]) -> str:
        if primitive.name == "abs":
            return _ABSOLUTE.format(*arguments)
        if primitive.name in _MATHML:
            return _MATHML[primitive.name].format(*arguments)
        safe = escape(primitive.name).encode("ascii", "xmlcharrefreplace").decode()
        return f"<mrow><mi>{safe}</mi>{_APPLY}{self.brackets.format('<mo>,</mo>'.join(arguments))}</mrow>"


class SignalNames(_ModelPrinter):
    """Names of the signals of a block, for printers of equations.

    A negative addend is subtracted: ``u(k-1) - 0.5*y(k-1)``.

    Parameters
    ----------
    signals : sequence of str
        Names by channel: ``y``, ``x1``, ``u2``.
    """

    def __init__(self, signals: Sequence[str]) -> None:
        self._signals = signals

    def write(self, expression: Expression) -> str:
        """Write an equation or a part of it."""
        return super().write(_take_sign(expression))

    def join(self, operator: Operator, arguments: Sequence[Expression]) -> str:
        """Write an operator between its operands."""
        if operator.own != SUM or operator.text != self.operators["add"].text:
            return super().join(operator, arguments)
        text = super().join(operator, [_take_sign(each) for each in arguments])
        return text.replace(f"{operator.text}{self.minus}", self.operators["sub"].text)

    def _write(self, expression: Expression) -> tuple[str, int]:
        match expression:
            case Apply(Primitive("neg", is_protected=False), (operand,)):
                return f"{self.minus}{self.write_operand(operand, QUOTIENT)}", QUOTIENT
        return super()._write(expression)

    def name(self, channel: int) -> str:
        """Return the name of a signal."""
        return self._signals[channel]


def _take_sign(expression: Expression) -> Expression:
    """Return a negative number, or a product that begins with one, as the negative of a positive one."""
    match expression:
        case Constant(number) if number < 0.0:
            return Apply(NEG, (Constant(-number),))
        case Apply(Primitive("mul"), (Constant(number), *others)) if number < 0.0:
            return Apply(NEG, (Apply(expression.primitive, (Constant(-number), *others)),))
    return expression


class PlainSignals(SignalNames, _ReaderPrinter):
    """Printer of a block as plain text."""


class LatexSignals(SignalNames, _LatexPrinter):
    """Printer of a block as LaTeX."""


class MathmlSignals(SignalNames, _MathmlPrinter):
    """Printer of a block as presentation MathML."""


_EQUATION = Printer()


@cache
def _make_printer(kind: type[_ModelPrinter], has_one_input: bool) -> _ModelPrinter:
    return kind(has_one_input)


def render(expression: Expression) -> str:
    """Write an expression of an equation as text that `parse_expression` converts back to it."""
    return _EQUATION.write(expression)


def program_text(
    expression: Expression,
    signal: Callable[[int, int], str],
    function: Callable[[Primitive], str],
    symbol: Callable[[str], str] = str,
) -> str:
    """Write an expression of a model in a programming language, in brackets if it is an operation.

    Parameters
    ----------
    expression : Expression
        In canonical form, with back-shifts at the leaves.
    signal : callable
        ``signal(channel, lag)`` returns the text of a sample.
    function : callable
        ``function(primitive)`` returns the name of a primitive's function.
    symbol : callable
        ``symbol(name)`` returns the text of a parameter.

    Raises
    ------
    ModelError
        The expression is not in canonical form.
    """

    def call(primitive: Primitive, arguments: Sequence[str]) -> str:
        return f"{function(primitive)}({', '.join(arguments)})"

    return ProgramPrinter(BRACKETED_OPERATORS, call, signal, symbol).write_operand(expression, ATOM)


def plain(expression: Expression, inputs: int = 1) -> str:
    """Write an expression as plain text that `parse` converts back to the same expression."""
    return _make_printer(_PlainPrinter, inputs == 1).write(expression)


def plain_factor(expression: Expression, inputs: int) -> str:
    """Write an expression as a factor of a product, in brackets if necessary; `parse` converts it back."""
    return _make_printer(_PlainPrinter, inputs == 1).write_operand(expression, PRODUCT)


def reader_text(expression: Expression, inputs: int) -> str:
    """Write an expression as text for readers, with the protection of its functions: ``sqrt(abs(u(k-1)))``.

    `parse` reads an expression of equal values from it. `plain` identifies the expression.
    """
    return _make_printer(_ReaderPrinter, inputs == 1).write(expression)


def reader_factor(expression: Expression, inputs: int) -> str:
    """Write an expression as `reader_text` does, as a factor of a product."""
    return _make_printer(_ReaderPrinter, inputs == 1).write_operand(expression, PRODUCT)


def at_rest(expression: Expression, inputs: int = 1) -> str:
    """Write a steady state (leaves of lag 0) for readers: ``y*u`` for ybar ubar, ``1`` for a constant."""
    return reader_text(expression, inputs).replace("(k)", "")


def latex(expression: Expression, inputs: int = 1) -> str:
    """Write an expression in LaTeX without dollar signs."""
    return _make_printer(_LatexPrinter, inputs == 1).write(expression)


def latex_factor(expression: Expression, inputs: int) -> str:
    """Write an expression in LaTeX as a factor of a product, in brackets if necessary."""
    return _make_printer(_LatexPrinter, inputs == 1).write_operand(expression, PRODUCT)


def mathml(expression: Expression, inputs: int = 1) -> str:
    """Write an expression as one element of presentation MathML, in ASCII."""
    return _make_printer(_MathmlPrinter, inputs == 1).write(expression)


def mathml_factor(expression: Expression, inputs: int) -> str:
    """Write an expression in MathML as a factor of a product, in brackets if necessary."""
    return _make_printer(_MathmlPrinter, inputs == 1).write_operand(expression, PRODUCT)


def _digits(number: float) -> str:
    return repr(float(number)).removesuffix(".0")


def latex_number(number: str) -> str:
    """Convert a number from Python's notation to LaTeX."""
    mantissa, _, exponent = number.partition("e")
    return mantissa if not exponent else rf"{mantissa} \times 10^{{{int(exponent)}}}"


def mathml_number(number: str) -> str:
    """Convert a number from Python's notation to MathML."""
    mantissa, _, exponent = number.removeprefix("-").partition("e")
    sign = MINUS if number.startswith("-") else ""
    power = f"<mo>&#xD7;</mo><msup><mn>10</mn>{mathml_number(str(int(exponent)))}</msup>" if exponent else ""
    return f"<mrow>{sign}<mn>{mantissa}</mn>{power}</mrow>" if sign or power else f"<mn>{mantissa}</mn>"


class EquationTextPrinter(Printer):
    """Printer of an equation as text."""

    def number(self, number: float) -> str:
        """Write a constant."""
        return "pi" if number == pi else super().number(number)

    def call(self, primitive: Primitive, arguments: Sequence[str]) -> str:
        """Write a function of arguments that are written."""
        if primitive.name == SIMULATION:
            return f"{primitive.name}[{', '.join(arguments)}]"
        return super().call(primitive, arguments)


class EquationMathmlPrinter(Printer):
    """Printer of an equation as presentation MathML in ASCII; each expression is one element."""

    operators: Mapping[str, Operator] = {
        "less": Operator("<mo>&lt;</mo>", COMPARISON, SUM, SUM),
        "less_equal": Operator("<mo>&#x2264;</mo>", COMPARISON, SUM, SUM),
        "add": Operator("<mo>+</mo>", SUM, SUM, PRODUCT),
        "sub": Operator(MINUS, SUM, SUM, PRODUCT),
        "mul": Operator(TIMES, PRODUCT, PRODUCT, PRODUCT),
        # A fraction and an exponent show what belongs to them.
        "div": Operator("<mfrac>{}{}</mfrac>", PRODUCT, COMPARISON, COMPARISON),
        "pow": Operator("<msup>{}{}</msup>", POWER, ATOM, COMPARISON),
    }
    brackets: ClassVar[str] = "<mrow><mo>(</mo>{}<mo>)</mo></mrow>"

    def _write(self, expression: Expression) -> tuple[str, int]:
        match expression:
            case Apply(primitive, (operand,)) if primitive == NEG:
                return f"<mrow>{MINUS}{self.write_operand(operand, SIGN)}</mrow>", SIGN
        return super()._write(expression)

    def symbol(self, name: str) -> str:
        """Write a name; what follows an underscore is an index."""
        first, _, index = name.partition("_")
        if not (first and index):
            return f"<mi>{_escape(name)}</mi>"
        return f"<msub><mi>{_escape(first)}</mi><mi>{_escape(index)}</mi></msub>"

    def number(self, number: float) -> str:
        """Write a constant."""
        return "<mi>&#x3C0;</mi>" if number == pi else mathml_number(repr(float(number)).removesuffix(".0"))

    def join(self, operator: Operator, arguments: Sequence[Expression]) -> str:
        """Write an operator between its operands."""
        if "{}" not in operator.text:
            return f"<mrow>{super().join(operator, arguments)}</mrow>"
        first, second = arguments
        return operator.text.format(
            self.write_operand(first, operator.first), self.write_operand(second, operator.others)
        )

    def call(self, primitive: Primitive, arguments: Sequence[str]) -> str:
        """Write a function of arguments that are written."""
        match primitive.name:
            case "abs":
                return f"<mrow><mo>|</mo>{arguments[0]}<mo>|</mo></mrow>"
            case "sqrt":
                return f"<msqrt>{arguments[0]}</msqrt>"
            case "exp":
                return f"<msup><mi>e</mi>{arguments[0]}</msup>"
        listed = "<mo>,</mo>".join(arguments)
        left, right = "[]" if primitive.name == SIMULATION else "()"
        name = self.symbol(primitive.name)
        return f"<mrow>{name}{_APPLY}<mrow><mo>{left}</mo>{listed}<mo>{right}</mo></mrow></mrow>"


def _escape(text: str) -> str:
    return escape(text).encode("ascii", "xmlcharrefreplace").decode()
