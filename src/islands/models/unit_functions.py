"""Functions of the units of a state space: trees of functions and products of one argument.

The text of a unit is the name of a function, as ``tanh``, a function of another one, as ``tanh(square)``, or
a product, as ``s*abs`` for s |s|, where ``s`` is the argument.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from islands.errors import ModelError

#: Text of each function with its argument. The code of a function for the kernel is its place, from 1 on.
FUNCTIONS: Mapping[str, str] = MappingProxyType(
    {
        "tanh": "tanh({0})",
        "square": "({0})^2",
        "cube": "({0})^3",
        "abs": "abs({0})",
        "hinge": "max({0}, 0)",
        "root": "sign({0})*sqrt({0})",
        "dead zone": "(max({0} + -1, 0) + min({0} + 1, 0))",
        "saturation": "min(max({0}, -1), 1)",
        "bell": "exp(-({0})^2)",
    }
)

#: Text of functions in equations for readers, if it is another one.
_NAMED_POWERS: Mapping[str, str] = MappingProxyType({"square": "square({0})", "cube": "cube({0})"})

#: Functions that are odd, and even.
_ODD = frozenset({"tanh", "cube", "root", "dead zone", "saturation"})
_EVEN = frozenset({"square", "abs", "bell"})

#: Names of the argument and of a product, which are no functions.
ARGUMENT, PRODUCT = "s", "*"

#: Digits of a code, and values that its evaluation keeps at the same time, at most: see the kernel.
_MOST_DIGITS, _MOST_VALUES = 15, 3

#: A symbol, or the name of a function.
_TOKENS = re.compile(r"[*()]|[^*()]+")


@dataclass(frozen=True, slots=True)
class UnitFunction:
    """A function of one argument, or a node of one.

    Attributes
    ----------
    name : str
        An entry of `FUNCTIONS`, `ARGUMENT` or `PRODUCT`.
    operands : tuple of UnitFunction
        One of a function, two of a product, none of the argument.
    """

    name: str
    operands: "tuple[UnitFunction, ...]" = ()

    def __str__(self) -> str:
        """Return the text, which `parse_unit` reads."""
        match self.operands:
            case ():
                return self.name
            case (operand,):
                return self.name if operand.name == ARGUMENT else f"{self.name}({operand})"
        first, second = self.operands
        return f"{first}*({second})" if second.name == PRODUCT else f"{first}*{second}"

    @property
    def operations(self) -> int:
        """Number of functions and products."""
        return bool(self.operands) + sum(each.operations for each in self.operands)

    @property
    def parity(self) -> int:
        """1 of an even function, -1 of an odd one, 0 of others."""
        if not self.operands:
            return -1
        first = self.operands[0].parity
        if self.name == PRODUCT:
            return first * self.operands[1].parity
        if first == 1 or self.name in _EVEN:
            return abs(first)
        return first if self.name in _ODD else 0

    def write(self, argument: str, functions: Mapping[str, str] = FUNCTIONS) -> str:
        """Return the text of an equation with an argument."""
        if self.name == ARGUMENT:
            return argument
        written = [each.write(argument, functions) for each in self.operands]
        if self.name == PRODUCT:
            return "*".join(f"({each})" for each in written)
        return functions[self.name].format(*written)

    def display(self, argument: str) -> str:
        """Return the text of an equation for readers."""
        return self.write(argument, {**FUNCTIONS, **_NAMED_POWERS})

    @property
    def code(self) -> int:
        """Code for the kernel: the operations in their order, in digits of base 16 from the last one on.

        The evaluation begins with the argument as the only value.
        """
        return sum(digit << 4 * place for place, digit in enumerate(self.list_digits()))

    def list_digits(self, *, begins: bool = True) -> Iterator[int]:
        """Yield the operations; those that begin the evaluation have the argument already."""
        for place, each in enumerate(self.operands):
            yield from each.list_digits(begins=begins and place == 0)
        if self.operands or not begins:
            yield _DIGITS[self.name]

    @property
    def values(self) -> int:
        """Number of values that an evaluation keeps at the same time."""
        return max((place + each.values for place, each in enumerate(self.operands)), default=1)


#: Odd functions in place of single ones, and of trees that are neither odd nor even.
_SIMILAR_ODD = {"square": "cube", "abs": "root", "hinge": "dead zone", "bell": "tanh"}
_OTHER_ODD = "tanh"

#: Digits of the operations: see the kernel.
_DIGITS = {**{name: code for code, name in enumerate(FUNCTIONS, start=1)}, ARGUMENT: 10, PRODUCT: 11}


@lru_cache(maxsize=4096)
def parse_unit(text: str) -> UnitFunction:
    """Read the function of a unit.

    Raises
    ------
    ModelError
        A name is unknown, a parenthesis is missing, or the function has too many operations.
    """
    tokens = [each.strip() for each in _TOKENS.findall(text)][::-1]
    found = _parse_product(tokens, text)
    if tokens:
        _refuse(text)
    digits = len(list(found.list_digits()))
    if not 0 < digits <= _MOST_DIGITS or found.values > _MOST_VALUES:
        raise ModelError(
            f"the unit {text!r} is too large or empty: at least one operation, at most {_MOST_DIGITS}, and "
            f"at most {_MOST_VALUES - 1} products in the second operands of each other"
        )
    return found


def _parse_product(tokens: list[str], text: str) -> UnitFunction:
    found = _parse_factor(tokens, text)
    while tokens and tokens[-1] == PRODUCT:
        tokens.pop()
        found = UnitFunction(PRODUCT, (found, _parse_factor(tokens, text)))
    return found


def _parse_factor(tokens: list[str], text: str) -> UnitFunction:
    name = tokens.pop() if tokens else ""
    inner = UnitFunction(ARGUMENT)
    if name == "(":
        tokens.append("(")
    elif name not in (*FUNCTIONS, ARGUMENT):
        _refuse(text)
    if tokens and tokens[-1] == "(" and name != ARGUMENT:
        tokens.pop()
        inner = _parse_product(tokens, text)
        if not tokens or tokens.pop() != ")":
            _refuse(text)
    return UnitFunction(name, (inner,)) if name in FUNCTIONS else inner


def _refuse(text: str) -> NoReturn:
    raise ModelError(
        f"unknown unit {text!r}; units are {', '.join(FUNCTIONS)}, functions of each other such as "
        "tanh(square), and products such as s*abs, where s is the argument"
    )


def make_odd_unit(text: str) -> str:
    """Return an odd unit in place of another one: an even function has its product with the argument."""
    tree = parse_unit(text)
    if tree.parity == -1:
        return text
    if text in _SIMILAR_ODD:
        return _SIMILAR_ODD[text]
    return str(UnitFunction(PRODUCT, (tree, UnitFunction(ARGUMENT)))) if tree.parity == 1 else _OTHER_ODD


def find_codes(units: Sequence[str]) -> NDArray[np.int64]:
    """Return the codes of units for the kernel."""
    return np.array([parse_unit(unit).code for unit in units], np.int64)


def evaluate_curve(unit: str, arguments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values of the function of a unit for arguments of any shape."""
    # A command that does not simulate loads no kernels.
    from islands.kernels.state_space import evaluate_unit  # noqa: PLC0415

    code = parse_unit(unit).code
    values = [evaluate_unit(code, s)[0] for s in np.ravel(arguments).tolist()]
    return np.array(values, dtype=np.float64).reshape(np.shape(arguments))
