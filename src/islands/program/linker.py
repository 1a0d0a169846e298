"""The linker: regressors in, one flat three-address program out.

Shared subexpressions are computed once, temporary rows are reused as soon as nobody reads them any more, and
products stay lists of factors that the kernel multiplies on the fly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from islands.kernels.machine import ADD, CALL, MAX_FACTORS, MULTIPLY, SIGN, SUBTRACT, Program
from islands.model.expression import Apply, Constant, Expression, Lagged
from islands.model.regressor import Regressor
from islands.program.row_functions import row_address

#: Primitives that the machine carries out itself; every other one is called through an address.
_OPERATIONS = {"add": ADD, "sub": SUBTRACT, "mul": MULTIPLY, "sign": SIGN}

#: An operand is a signal some samples back, (channel, lag), or (TEMPORARY, index).
TEMPORARY = -1
_Operand = tuple[int, int]


def link(terms: Sequence[Regressor | Expression]) -> Program:
    """Link regressors, one term each and in the order given.

    A term may also be a bare canonical expression of lag 0, the target y(k) for instance: the kernel of
    columns allows it, a simulation does not.
    """
    expressions = [term.expression if isinstance(term, Regressor) else term for term in terms]
    assembly = _Assembly()
    products = [_factors(assembly, expression) for expression in expressions]
    code, products, rows = _with_reused_rows(assembly.code, products, len(assembly.constants))
    operands: dict[_Operand, int] = {}

    def index(operand: _Operand) -> int:
        return operands.setdefault(operand, len(operands))

    flat = [(operation, target, index(a), index(b)) for operation, target, a, b in code]
    factors = np.zeros((len(products), MAX_FACTORS), np.int64)
    for term, product in enumerate(products):
        factors[term, : len(product)] = [index(operand) for operand in product]
    return Program(
        code=np.array(flat, np.int64).reshape(-1, 4),
        addresses=np.array(assembly.addresses, np.int64),
        operands=np.array(list(operands), np.int64).reshape(-1, 2),
        constants=np.array(list(assembly.constants), np.float64),
        temporaries=rows,
        factors=factors,
        degree=np.array([len(product) for product in products], np.int64),
    )


_Instruction = tuple[int, int, _Operand, _Operand]


@dataclass(slots=True)
class _Assembly:
    """Code under construction; every temporary is written once until rows are reused."""

    code: list[_Instruction] = field(default_factory=list)
    addresses: list[int] = field(default_factory=list)
    constants: dict[float, int] = field(default_factory=dict)
    known: dict[Expression, _Operand] = field(default_factory=dict)
    emitted: dict[tuple[int, _Operand, _Operand, int], _Operand] = field(default_factory=dict)

    def emit(self, operation: int, first: _Operand, second: _Operand, address: int = 0) -> _Operand:
        key = (operation, first, second, address)
        if key not in self.emitted:
            self.emitted[key] = (TEMPORARY, len(self.code))
            self.code.append((operation, len(self.code), first, second))
            self.addresses.append(address)
        return self.emitted[key]

    def constant(self, value: float) -> _Operand:
        # Constants come before all other temporaries: a place below zero until rows are numbered.
        return (TEMPORARY, -1 - self.constants.setdefault(value, len(self.constants)))


def _operand(assembly: _Assembly, expression: Expression) -> _Operand:
    match expression:
        case Lagged(channel, lag):
            return (channel, lag)
        case Constant(value):
            return assembly.constant(value)
    if expression not in assembly.known:
        assembly.known[expression] = _compute(assembly, expression)
    return assembly.known[expression]


def _compute(assembly: _Assembly, expression: Expression) -> _Operand:
    assert isinstance(expression, Apply), "a canonical expression has its back-shifts at the leaves"
    arguments = [_operand(assembly, argument) for argument in expression.arguments]
    name = expression.primitive.name
    if name not in _OPERATIONS:
        address = row_address(expression.primitive)
        return assembly.emit(CALL, arguments[0], arguments[-1], address)
    if len(arguments) == 1:
        return assembly.emit(_OPERATIONS[name], arguments[0], arguments[0])
    result = arguments[0]
    for argument in arguments[1:]:
        result = assembly.emit(_OPERATIONS[name], result, argument)
    return result


def _factors(assembly: _Assembly, expression: Expression) -> list[_Operand]:
    """Return at most `MAX_FACTORS` operands whose product is the term."""
    product = isinstance(expression, Apply) and expression.primitive.name == "mul"
    parts = list(expression.arguments) if isinstance(expression, Apply) and product else [expression]
    factors = [_operand(assembly, part) for part in parts]
    while len(factors) > MAX_FACTORS:
        factors[:2] = [assembly.emit(MULTIPLY, factors[0], factors[1])]
    return factors


def _with_reused_rows(
    code: list[_Instruction], products: list[list[_Operand]], constants: int
) -> tuple[list[_Instruction], list[list[_Operand]], int]:
    """Give the temporaries rows; a row is taken again when its value is dead.

    A target never takes the row of an operand of the same instruction: a row function may not overlap.
    """
    last_use: dict[int, int] = {}
    for position, (_, _, first, second) in enumerate(code):
        for channel, index in (first, second):
            if channel == TEMPORARY:
                last_use[index] = position
    for product in products:
        last_use |= {index: len(code) for channel, index in product if channel == TEMPORARY}

    row: dict[int, int] = {-1 - index: index for index in range(constants)}
    free: list[int] = []
    rows = constants

    def placed(operand: _Operand) -> _Operand:
        return (TEMPORARY, row[operand[1]]) if operand[0] == TEMPORARY else operand

    renumbered: list[_Instruction] = []
    for position, (operation, target, first, second) in enumerate(code):
        if not free:
            free.append(rows)
            rows += 1
        row[target] = free.pop()
        renumbered.append((operation, row[target], placed(first), placed(second)))
        for channel, index in dict.fromkeys((first, second)):
            if channel == TEMPORARY and index >= 0 and last_use[index] == position:
                free.append(row[index])
    return renumbered, [[placed(operand) for operand in product] for product in products], rows
