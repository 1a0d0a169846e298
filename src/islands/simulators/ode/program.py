"""Translation of a system to instructions, without compilation.

Equal subexpressions are computed once. What depends on parameters alone is computed before the first step,
what depends on time and signals once for each instant, and what only the outputs need once for each sample.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import factorial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from islands.errors import ModelError
from islands.expressions.printing import render
from islands.expressions.tree import FMU, SIGNAL_FUNCTIONS, Apply, Constant, Expression, Primitive, Symbol
from islands.kernels.interpreter import ADD, MULTIPLY, SIGN, SUBTRACT
from islands.simulators.ode import kernel as ode_kernel
from islands.simulators.ode.equation_parser import FORCE, TIME
from islands.simulators.ode.kernel_arguments import Instructions
from islands.simulators.ode.system import OdeSystem, sort_variables

#: Sixth convergent of Lambert's continued fraction of tanh: coefficients of its numerator and denominator, in
#: powers of the square of the argument.
_NUMERATOR = (1.0, 4.0 / 33.0, 1.0 / 495.0)
_DENOMINATOR = (1.0, 5.0 / 11.0, 2.0 / 99.0, 1.0 / 10395.0)

#: Argument above which the hyperbolic tangent is 1 in double precision.
_SATURATION = 20.0

#: Number of times that an argument is halved; the error of the convergent is then below the rounding.
_HALVINGS = 6

#: Taylor series of sin(x)/x in powers of the square of x, which is at most pi/2.
_SINE = tuple((-1.0) ** k / factorial(2 * k + 1) for k in range(12))

#: Inverse of pi, and pi as a sum of three numbers. Products of the first two with an integer of 20 bits are
#: exact (Cody and Waite, Software Manual for the Elementary Functions, 1980).
_INVERSE_PI = 0.3183098861837907
_PI = (3.1415926534682512, 1.2154201012607932e-10, 4.04453249759190126e-21)

#: Number to which another one is added and from which it is subtracted to round it to an integer.
_ROUNDING = 1.5 * 2.0**52

#: Makes the node of an operation on nodes.
Operate = Callable[..., int]

#: Largest number of instructions.
MAX_INSTRUCTIONS = 5000

#: Exponents of powers that are multiplications.
_MULTIPLIED_POWERS = range(2, 9)

_OPERATIONS: Mapping[str, int] = MappingProxyType(
    {
        "add": ADD,
        "sub": SUBTRACT,
        "mul": MULTIPLY,
        "div": ode_kernel.DIVIDE,
        "pow": ode_kernel.POWER,
        "neg": ode_kernel.NEGATE,
        "less": ode_kernel.LESS,
        "less_equal": ode_kernel.LESS_EQUAL,
        "abs": ode_kernel.ABSOLUTE,
        "sqrt": ode_kernel.SQUARE_ROOT,
        "exp": ode_kernel.EXPONENTIAL,
        "log": ode_kernel.LOGARITHM,
        "tan": ode_kernel.TANGENT,
        "atan": ode_kernel.ARC_TANGENT,
        "sign": SIGN,
        "min": ode_kernel.MINIMUM,
        "max": ode_kernel.MAXIMUM,
        "where": ode_kernel.SELECT,
    }
)

#: Instruction of a sum or difference whose second operand is a product.
_WITH_PRODUCT: Mapping[int, int] = MappingProxyType(
    {ADD: ode_kernel.ADD_PRODUCT, SUBTRACT: ode_kernel.SUBTRACT_PRODUCT}
)

# Sections of the code, by what an instruction depends on.
_PARAMETERS, _SIGNALS, _STATES, _OUTPUTS = range(4)


class CompositeFunctions:
    """Generator of functions of nodes.

    Parameters
    ----------
    operate : callable
    make_number : callable
        Makes the node of a number.
    """

    def __init__(self, operate: Operate, make_number: Callable[[float], int]) -> None:
        self._operate, self._number = operate, make_number

    def power(self, base: int, power: int) -> int:
        """Generate a power with an exponent of at least 1 as multiplications."""
        if power == 1:
            return base
        half = self.power(base, power // 2)
        square = self._operate(MULTIPLY, half, half)
        return self._operate(MULTIPLY, square, base) if power % 2 else square

    def tanh(self, argument: int) -> int:
        """Generate a hyperbolic tangent; its relative error is at most 1.2e-15, and a NaN remains.

        Numerator p and denominator q of ``tanh x`` give ``tanh 2x = 2pq/(p**2 + q**2)``.
        """
        operate = self._operate
        x = operate(MULTIPLY, self._clip(argument, _SATURATION), self._number(0.5**_HALVINGS))
        square = operate(MULTIPLY, x, x)
        p = operate(MULTIPLY, x, self._evaluate(_NUMERATOR, square))
        q = self._evaluate(_DENOMINATOR, square)
        for _ in range(_HALVINGS):
            squares = operate(ADD, operate(MULTIPLY, p, p), operate(MULTIPLY, q, q))
            p, q = operate(MULTIPLY, operate(ADD, p, p), q), squares
        return self._clip(operate(ode_kernel.DIVIDE, p, q), 1.0)

    def sine(self, argument: int) -> int:
        """Generate a sine; its error is at most 5e-16 up to an argument of 1e6, and a NaN remains."""
        return self._generate_wave(argument, 0.0)

    def cosine(self, argument: int) -> int:
        """Generate a cosine; see `sine`."""
        return self._generate_wave(argument, 0.5)

    def _generate_wave(self, argument: int, shift: float) -> int:
        """Generate ``sin(x + pi*shift)`` of the argument x.

        With an integer n, it is ``(-1)**n * sin(r)``, and ``r = x + pi*(shift - n)`` is at most pi/2.
        """
        operate, number = self._operate, self._number
        half_turns = operate(MULTIPLY, argument, number(_INVERSE_PI))
        if shift:
            half_turns = operate(ADD, half_turns, number(shift))
        n = self._round(half_turns)
        turned = operate(SUBTRACT, n, number(shift)) if shift else n
        r = argument
        for part in _PI:
            r = operate(SUBTRACT, r, operate(MULTIPLY, turned, number(part)))
        sine = operate(MULTIPLY, r, self._evaluate(_SINE, operate(MULTIPLY, r, r)))
        even = self._round(operate(MULTIPLY, n, number(0.5)))
        odd = operate(SUBTRACT, n, operate(ADD, even, even))  # -1, 0 or 1
        sign = operate(SUBTRACT, number(1.0), operate(MULTIPLY, operate(ADD, odd, odd), odd))
        return self._clip(operate(MULTIPLY, sine, sign), 1.0)

    def _round(self, node: int) -> int:
        shifted = self._operate(ADD, node, self._number(_ROUNDING))
        return self._operate(SUBTRACT, shifted, self._number(_ROUNDING))

    def _clip(self, node: int, limit: float) -> int:
        # A comparison with NaN gives the second operand.
        below = self._operate(ode_kernel.MINIMUM, self._number(limit), node)
        return self._operate(ode_kernel.MAXIMUM, self._number(-limit), below)

    def _evaluate(self, coefficients: Sequence[float], variable: int) -> int:
        *lower, value = map(self._number, coefficients)
        for coefficient in reversed(lower):
            value = self._operate(ADD, coefficient, self._operate(MULTIPLY, value, variable))
        return value


@dataclass(frozen=True, slots=True, eq=False)
class OdeProgram:
    """Instructions of a system, and the contents of the rows that the caller fills.

    Attributes
    ----------
    instructions : Instructions
    constants : ndarray, shape (constants,)
        Values of the first rows.
    parameters : tuple of str
        Names of the parameters, whose rows follow those of the constants.
    signals : tuple of expression
        Time, signals, their rates and delays, and what an FMU computes, in the order of their rows.
    states : tuple of str
    """

    instructions: Instructions
    constants: NDArray[np.float64]
    parameters: tuple[str, ...]
    signals: tuple[Expression, ...]
    states: tuple[str, ...]


@dataclass(slots=True)
class _Node:
    """An operation on other nodes, or a leaf with operation -1. ``level`` is its section, ``row`` its row."""

    operation: int
    operands: tuple[int, ...]
    level: int
    row: int = -1
    uses: int = 0


def generate_program(system: OdeSystem, outputs: Sequence[Expression] = (), laws: int = 0) -> OdeProgram:
    """Generate the instructions of a system.

    Parameters
    ----------
    system : OdeSystem
    outputs : sequence of expression
        Outputs instead of that of the system, for example states.
    laws : int

    Raises
    ------
    ModelError
        The system has more than `MAX_INSTRUCTIONS`.
    """
    return _Generator(system, laws).generate(tuple(outputs) or (system.output,))


class _Generator:
    def __init__(self, system: OdeSystem, laws: int) -> None:
        self.system, self.laws = system, laws
        self.nodes: list[_Node] = []
        self.constants: list[float] = []
        self.signals: list[Expression] = []
        self._known: dict[object, int] = {}
        self._named: dict[str, int] = {}
        self._sections: tuple[list[tuple[int, ...]], ...] = ([], [], [], [])
        self._rows = 0
        self._functions = CompositeFunctions(self._operation, self._number)

    def generate(self, outputs: tuple[Expression, ...]) -> OdeProgram:
        system, laws = self.system, self.laws
        for parameter in system.parameters:
            self._named[parameter.name] = self._leaf(_PARAMETERS)
        for name, _ in system.derivatives:
            self._named[name] = self._leaf(_STATES)
        variables = dict(system.variables)
        for name in sort_variables(system):
            # Variables that no derivative and no output reads get no instruction.
            self._named[name] = self._make(variables[name])
        slopes = [self._make(right) for _, right in system.derivatives]
        read = [self._make(output) for output in outputs]
        # The states of the laws need their derivatives even if no equation reads the forces.
        derived = [*slopes, *([self._force()] if laws else [])]
        leaves = self._place_leaves()
        first_state = leaves - len(system.derivatives)
        own_slopes = leaves + laws
        self._rows = own_slopes + laws
        for node in (*derived, *read):
            self._count(node)
        for node in derived:
            self._emit(node, outputs_only=False)
        for node in read:
            self._emit(node, outputs_only=True)
        slope_rows = [self._slope_row(index, node, first_state) for index, node in enumerate(slopes)]
        code = [instruction for section in self._sections for instruction in section]
        if len(code) > MAX_INSTRUCTIONS:
            raise ModelError(f"the equations have {len(code)} operations, and {MAX_INSTRUCTIONS} is the most")
        instructions = Instructions(
            np.array(code, dtype=np.int64).reshape(-1, 5),
            np.cumsum([len(section) for section in self._sections]),
            np.arange(first_state - len(self.signals), first_state),
            first_state,
            np.array([*slope_rows, *range(own_slopes, own_slopes + laws)], dtype=np.int64),
            np.array([self.nodes[node].row for node in read], dtype=np.int64),
            self._rows,
        )
        return OdeProgram(
            instructions,
            np.array(self.constants),
            tuple(parameter.name for parameter in system.parameters),
            tuple(self.signals),
            tuple(name for name, _ in system.derivatives),
        )

    def _place_leaves(self) -> int:
        """Give each leaf its row, in the order of `OdeProgram`; return their number."""
        leaves = [
            *(self._known["number", value] for value in self.constants),
            *(self._named[parameter.name] for parameter in self.system.parameters),
            *(self._known["signal", render(signal)] for signal in self.signals),
            *(self._named[name] for name, _ in self.system.derivatives),
        ]
        for row, node in enumerate(leaves):
            self.nodes[node].row = row
        return len(leaves)

    def _slope_row(self, index: int, node: int, first_state: int) -> int:
        row = self.nodes[node].row
        # A state that is updated before is no longer the value of this stage.
        if first_state <= row < first_state + index:
            self._sections[_STATES].append((ode_kernel.COPY, self._rows, row, row, row))
            row, self._rows = self._rows, self._rows + 1
        return row

    def _leaf(self, level: int) -> int:
        self.nodes.append(_Node(-1, (), level))
        return len(self.nodes) - 1

    def _make(self, expression: Expression) -> int:
        """Return the node of an expression."""
        match expression:
            case Constant(value):
                return self._number(value)
            case Symbol(name) if name in self._named:
                return self._named[name]
            case Symbol(name) if name == FORCE:
                return self._force()
            case Symbol(name) if name == TIME or name in self.system.signals:
                return self._signal(expression)
            case Symbol(name):
                raise ModelError(f"unknown name {name!r} in an equation")
            case Apply(primitive, _) if primitive in (*SIGNAL_FUNCTIONS, FMU):
                return self._signal(expression, _STATES if primitive == FMU else _SIGNALS)
            case Apply(Primitive("pow"), (base, Constant(power))) if power in _MULTIPLIED_POWERS:
                return self._functions.power(self._make(base), int(power))
            case Apply(Primitive("tanh"), (argument,)):
                return self._functions.tanh(self._make(argument))
            case Apply(Primitive("sin"), (argument,)):
                return self._functions.sine(self._make(argument))
            case Apply(Primitive("cos"), (argument,)):
                return self._functions.cosine(self._make(argument))
            case Apply(primitive, arguments):
                return self._operation(_OPERATIONS[primitive.name], *map(self._make, arguments))
        raise ModelError(f"an equation reads {render(expression)}")

    def _number(self, value: float) -> int:
        if ("number", value) not in self._known:
            self._known["number", value] = self._leaf(_PARAMETERS)
            self.constants.append(value)
        return self._known["number", value]

    def _signal(self, expression: Expression, level: int = _SIGNALS) -> int:
        key = "signal", render(expression)
        if key not in self._known:
            self._known[key] = self._leaf(level)
            self.signals.append(expression)
        return self._known[key]

    def _force(self) -> int:
        assert self.system.force is not None
        if not self.laws:
            return self._number(0.0)
        if "force" not in self._known:
            operands = [
                self._make(Symbol(name)) for name in (self.system.force.coordinate, self.system.force.rate)
            ]
            # The states of the laws change even if the coordinate does not.
            self._known["force"] = self._operation(ode_kernel.FORCES, *operands, level=_STATES)
        return self._known["force"]

    def _operation(self, operation: int, *operands: int, level: int = _PARAMETERS) -> int:
        key = operation, operands
        if key not in self._known:
            level = max(level, *(self.nodes[each].level for each in operands))
            self.nodes.append(_Node(operation, operands, level))
            self._known[key] = len(self.nodes) - 1
        return self._known[key]

    def _count(self, root: int) -> None:
        """Count how often each node below a root is read."""
        stack = [root]
        while stack:
            node = self.nodes[stack.pop()]
            node.uses += 1
            if node.uses == 1:
                stack += node.operands

    def _emit(self, root: int, outputs_only: bool) -> None:
        """Append the instructions of a node and of all that it reads."""
        stack = [root]
        while stack:
            node = self.nodes[stack[-1]]
            operation, operands = self._fuse(node)
            missing = [operand for operand in operands if self.nodes[operand].row < 0]
            if node.row < 0 and missing:
                stack += reversed(missing)
                continue
            stack.pop()
            if node.row < 0:
                node.row, self._rows = self._rows, self._rows + 1
                rows = [self.nodes[operand].row for operand in operands]
                padded = (rows * 3)[:3] if rows else [0, 0, 0]
                section = _OUTPUTS if outputs_only and node.level > _PARAMETERS else node.level
                self._sections[section].append((operation, node.row, *rows, *padded[len(rows) :]))

    def _fuse(self, node: _Node) -> tuple[int, tuple[int, ...]]:
        """Return the instruction of a node; a product that only this sum reads becomes part of it."""
        if node.operation in _WITH_PRODUCT:
            first, second = node.operands
            candidates = [(first, second)] + ([(second, first)] if node.operation == ADD else [])
            for kept, product in candidates:
                inner = self.nodes[product]
                if (
                    inner.operation == MULTIPLY
                    and inner.uses == 1
                    and inner.row < 0
                    and inner.level == node.level
                    and kept != product
                ):
                    return _WITH_PRODUCT[node.operation], (kept, *inner.operands)
        return node.operation, node.operands
