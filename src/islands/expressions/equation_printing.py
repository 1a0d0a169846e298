"""Printers of equations for readers: text, and presentation MathML.

Names remain as they are, so that a reader finds them in tables and files.
"""

from collections.abc import Mapping, Sequence
from html import escape
from math import pi
from typing import ClassVar

from islands.expressions.primitives import NEG
from islands.expressions.printing import (
    ATOM,
    COMPARISON,
    MINUS,
    POWER,
    PRODUCT,
    SIGN,
    SUM,
    TIMES,
    Operator,
    Printer,
    mathml_number,
)
from islands.expressions.tree import Apply, Expression, Primitive

#: Function with its argument in square brackets: the simulation of a signal as a whole.
SIMULATION = "G"


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


#: Function application (U+2061).
_APPLY = "<mo>&#x2061;</mo>"


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
