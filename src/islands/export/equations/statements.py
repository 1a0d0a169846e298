"""Expressions and statements of a program, in any language with structures."""

import re
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from islands.export.equations.extended_system import ExtendedEquations
from islands.export.equations.language import Language
from islands.expressions.primitives import POW
from islands.expressions.printing import EQUATION_OPERATORS, ProgramPrinter, render
from islands.expressions.tree import (
    SIGNAL_FUNCTIONS,
    Apply,
    Expression,
    Primitive,
    Symbol,
    find_symbols,
    replace,
    substitute,
    walk,
)
from islands.models.block import quote_name
from islands.simulators.ode.equation_parser import TIME
from islands.simulators.ode.system import sort_variables
from islands.simulators.ode.system_document import SIMULATED

#: Reserved words of C, names of its macros, reserved words of MATLAB, and members of structures in programs.
_RESERVED = frozenset(
    """
    alignas alignof auto bool break case char const constexpr continue default do double else enum extern
    false float for goto if inline int long nullptr register restrict return short signed sizeof static
    static_assert struct switch thread_local true typedef typeof typeof_unqual union unsigned void volatile
    while NAN INFINITY NULL HUGE_VAL RAND_MAX EXIT_SUCCESS EXIT_FAILURE unix linux i386 assert errno
    catch classdef elseif end endfunction endif endfor endwhile function global otherwise parfor
    persistent spmd try until unwind_protect samples none
    """.split()  # noqa: SIM905
)

#: Largest length; C and MATLAB distinguish 63 characters.
_LENGTH = 55


def make_identifiers(names: Iterable[str]) -> dict[str, str]:
    """Return a different identifier for each name, which is the name itself if possible.

    A minus sign before a digit becomes ``m``, so that ``at -0.25`` and ``at 0.25`` differ.
    """
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in dict.fromkeys(names):
        text = re.sub(r"\W+", "_", re.sub(r"-(?=\d)", "m", name), flags=re.ASCII).strip("_")[:_LENGTH]
        if not text or not text[0].isalpha():
            text = f"n{text}"
        if text in _RESERVED:
            text += "_"
        number, unique = 2, text
        while unique in taken:
            unique, number = f"{text}_{number}", number + 1
        taken.add(unique)
        found[name] = unique
    return found


#: Least number of operations of a part that gets a name.
_MIN_OPERATIONS = 4


def take_common_parts(
    expressions: Sequence[Expression], prefix: str
) -> tuple[list[tuple[str, Expression]], list[Expression]]:
    """Give names to the parts that occur repeatedly in expressions.

    Returns
    -------
    list of (str, expression)
        Names, which begin with ``prefix``, and parts, in an order in which each one follows those it reads.
    list of expression
        The expressions with these names.
    """
    parts: list[tuple[str, Expression]] = []
    remaining = list(expressions)
    while True:
        counts = Counter(each for one in [*remaining, *(part for _, part in parts)] for each in _walk(one))
        repeated = [each for each, count in counts.items() if count > 1 and _count(each) >= _MIN_OPERATIONS]
        if not repeated:
            return parts[::-1], remaining
        largest = max(repeated, key=_count)
        name = f"{prefix}{len(parts) + 1}"
        remaining = [_replace(each, largest, Symbol(name)) for each in remaining]
        parts = [(known, _replace(part, largest, Symbol(name))) for known, part in parts]
        parts.append((name, largest))


def _walk(expression: Expression) -> list[Expression]:
    return [part for part in walk(expression) if isinstance(part, Apply)]


def _count(expression: Expression) -> int:
    return len(_walk(expression))


def _replace(expression: Expression, part: Expression, name: Symbol) -> Expression:
    return replace(expression, lambda each: name if each == part else None)


#: Functions that are not functions of every language, and the names of their definitions in programs.
DEFINED = {
    "less": "less",
    "less_equal": "less_equal",
    "sign": "sign_of",
    "min": "minimum",
    "max": "maximum",
    "where": "choose",
}

#: Functions that are operators in every language.
_OPERATORS = {name: EQUATION_OPERATORS[name] for name in ("add", "sub", "mul", "div")}

#: Name of the input at three moments of each step, after maps with memory.
MOMENTS = "input moments"

#: Columns of a line.
_WIDTH = 108


@dataclass(frozen=True)
class EquationCode:
    """Writer of the parts of a program."""

    equations: ExtendedEquations
    language: Language

    @cached_property
    def signals(self) -> tuple[Expression, ...]:
        """Signals that the equations read: input, channels, time, gain, their rates and delays."""
        system = self.equations.system
        needed = [right for _, right in (*system.derivatives, *system.variables)]
        read: dict[str, Expression] = {}
        for right in (*needed, system.output):
            for signal in _find_signals(right, {*system.signals, TIME}):
                read.setdefault(render(signal), signal)
        return tuple(read.values())

    @property
    def read_signals(self) -> tuple[Expression, ...]:
        """Signals that are read from the record: all but the simulated output."""
        is_sampled = self.equations.core is not None
        return tuple(each for each in self.signals if not (is_sampled and each == Symbol(SIMULATED)))

    @cached_property
    def identifiers(self) -> Mapping[str, str]:
        """Identifiers of all names, and of signals by their text."""
        given = self.equations
        names = [*given.values, *given.start, *(name for name, _ in given.system.variables), *given.columns]
        return make_identifiers([*names, MOMENTS, *(render(each) for each in self.signals)])

    @cached_property
    def _members(self) -> dict[str, str]:
        """Texts of all names in the equations."""
        given, own, member = self.equations, self.identifiers, self.language.member
        members = {name: f"p{member}{own[name]}" for name in given.values}
        members |= {name: f"s{member}{own[name]}" for name in given.start}
        members |= {name: f"w.{own[name]}" for name, _ in given.system.variables}
        return members | {render(each): f"in{member}{own[render(each)]}" for each in self.signals}

    def write(self, expression: Expression, local: Mapping[str, str] | None = None) -> str:
        """Write an expression; ``local`` has the texts of further names."""
        texts = {**self._members, **(local or {})}
        printer = ProgramPrinter(_OPERATORS, self._call, symbol=lambda name: texts.get(name, name))
        return printer.write(_name_signals(expression))

    def _call(self, function: Primitive, arguments: Sequence[str]) -> str:
        if function == POW:
            return self.language.power.format(*arguments)
        name = function.name
        return f"{self.language.functions.get(name, DEFINED.get(name, name))}({', '.join(arguments)})"

    def assign(
        self, targets: Sequence[tuple[str, Expression]], local: Mapping[str, str] | None = None
    ) -> list[str]:
        """Write statements that assign expressions to targets; common parts are computed before."""
        lines = []
        for number, (target, expression) in enumerate(targets, start=1):
            parts, (rest,) = take_common_parts([expression], f"part{number}_" if len(targets) > 1 else "part")
            for name, part in parts:
                lines += self.wrap(f"{self.language.declare}{name} = {self.write(part, local)};")
            lines += self.wrap(f"{target} = {self.write(rest, local)};")
        return lines

    def wrap(self, line: str) -> list[str]:
        """Break a long statement between its operations."""
        lines = textwrap.wrap(
            line, _WIDTH - 12, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
        )
        return [f"{each}{self.language.continuation}" for each in lines[:-1]] + lines[-1:]

    def assign_variables(self, readers: Iterable[Expression]) -> list[str]:
        """Write the variables that expressions read, each after those that it reads."""
        system = self.equations.system
        right_sides = dict(system.variables)
        needed: set[str] = set()
        open_names = [name for each in readers for name in find_symbols(each)]
        while open_names:
            name = open_names.pop()
            if name in right_sides and name not in needed:
                needed.add(name)
                open_names += find_symbols(right_sides[name])
        ordered = [name for name in sort_variables(system) if name in needed]
        return [
            line for name in ordered for line in self.assign([(self.write(Symbol(name)), right_sides[name])])
        ]

    def find_functions(self, text: str) -> list[str]:
        """Return the functions of `DEFINED` that a program calls."""
        return [function for function, name in DEFINED.items() if f"{name}(" in text]

    def describe(self) -> list[str]:
        """Return the equations and the settings of the integration as lines of a comment, in ASCII."""
        given, own = self.equations, self.identifiers
        symbols: dict[str, Expression] = {name: Symbol(text) for name, text in own.items()}
        system, core = given.system, given.core
        renamed = [(own[name], substitute(right, symbols)) for name, right in system.derivatives]
        lines = [f"Extended simulation: {system.name}, {quote_name(given.output)} from"]
        lines += [f"    {own[name]} = {quote_name(column)}" for name, column in given.columns.items()]
        if core is not None:
            lines += ["", f"    {SIMULATED} = {core.summary}"]
        lines += ["", *(f"    d{name}/dt = {render(right)}" for name, right in renamed)]
        lines += [
            f"    {own[name]} = {render(substitute(right, symbols))}" for name, right in system.variables
        ]
        lines += [f"    output = {render(substitute(system.output, symbols))}", ""]
        lines += [f"Effect {each}." for each in given.effects]
        if core is not None:
            lines.append(f"Sampling time {given.dt:.10g} s.")
            return _wrap(lines)
        count = given.steps * given.times
        lines += [
            f"Sampling time {given.dt:.10g} s; input between samples: {given.hold}.",
            f"Classical Runge-Kutta method, {count} {'steps' if count > 1 else 'step'} per sample.",
        ]
        if system.shooting:
            lines.append(
                "This is a free run. The simulation of the package restarts every "
                f"{system.shooting:g} s from states that are fitted to the measured output."
            )
        return _wrap(lines)

    def list_parameters(self) -> list[tuple[str, str, str]]:
        """Return identifier, value and comment of each parameter."""
        return [
            (self.identifiers[name], repr(float(each.value)), _to_ascii(simplify(each.unit)))
            for name, each in self.equations.values.items()
        ]

    def list_states(self) -> list[tuple[str, str, str]]:
        """Return identifier, value at the first sample and comment of each state."""
        return [
            (self.identifiers[name], repr(float(each.value)), _to_ascii(simplify(each.unit)))
            for name, each in self.equations.start.items()
        ]


def make_step(code: EquationCode, access: str, names: Iterable[str], time: str) -> list[str]:
    """Write the sum of the slopes of a step of the Runge-Kutta method, for states with these identifiers."""
    lines = []
    for name in names:
        slopes = f"first.{name} + 2.0*second.{name} + 2.0*third.{name} + fourth.{name}"
        lines += code.wrap(f"{access}{name} = {access}{name} + {time}/6.0*({slopes});")
    return lines


def simplify(unit: str) -> str:
    """Return a unit as the text of a comment."""
    return "1" if unit in ("", "1") else unit


def _wrap(lines: Iterable[str]) -> list[str]:
    """Return lines of a comment."""
    return [
        _to_ascii(part)
        for line in lines
        for part in textwrap.wrap(line, 100, subsequent_indent="        ", break_long_words=False) or [""]
    ]


def _to_ascii(text: str) -> str:
    """Return a text that cannot end a comment or a line, in ASCII."""
    plain = text.replace("°", "deg").replace("µ", "u").replace("??", "? ?")
    plain = plain.replace("*/", "* /").replace("/*", "/ *")
    return re.sub(r"[^ -~]", lambda found: f"\\u{ord(found[0]):04x}", plain)


def _find_signals(expression: Expression, names: set[str]) -> Iterator[Expression]:
    match expression:
        case Symbol(name) if name in names:
            yield expression
        case Apply(primitive, _) if primitive in SIGNAL_FUNCTIONS:
            yield expression
        case Apply(_, arguments):
            for argument in arguments:
                yield from _find_signals(argument, names)


def _name_signals(expression: Expression) -> Expression:
    """Return an expression in which rates and delays are names."""

    def find(part: Expression) -> Symbol | None:
        return (
            Symbol(render(part)) if isinstance(part, Apply) and part.primitive in SIGNAL_FUNCTIONS else None
        )

    return replace(expression, find)
