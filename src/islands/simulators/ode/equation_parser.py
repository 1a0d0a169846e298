"""Parser of equations: one per line, ``dx/dt = ...`` for a state, ``name = ...`` for a variable."""

import keyword
import re
from dataclasses import dataclass

from islands.errors import ModelError
from islands.expressions.parsing import CONSTANTS, parse_expression
from islands.expressions.primitives import EQUATION_FUNCTIONS
from islands.expressions.tree import SIGNAL_FUNCTIONS, Expression

#: Largest number of characters of all equations.
MAX_CHARACTERS = 20_000

#: Name of the time in seconds.
TIME = "t"

#: Name of the sum of the forces of force laws.
FORCE = "force"

#: Names that have a meaning in every equation.
_MEANINGS = frozenset(
    (*EQUATION_FUNCTIONS, *(each.name for each in SIGNAL_FUNCTIONS), *CONSTANTS, TIME, FORCE)
)

_DERIVATIVE = re.compile(r"d\s*([A-Za-z_]\w*)\s*/\s*dt")


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
    expression: Expression
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
