"""The store: expressions as numbers, so that kernels can tell them apart, share and link them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from islands.kernels import codegen, interpreter
from islands.kernels.codegen import CONSTANT, LAGGED, NodeArrays
from islands.kernels.interpreter import CALL, MAX_FACTORS, MULTIPLY, Program
from islands.model.expression import Apply, Constant, Expression, Lagged, Primitive
from islands.model.primitives import ADD, MUL, SIGN, SUB
from islands.model.regressor import Regressor
from islands.program.primitive_functions import row_address

#: Primitives that the machine carries out itself; every other one is called through an address.
_OPERATIONS = {ADD: interpreter.ADD, SUB: interpreter.SUBTRACT, MUL: MULTIPLY, SIGN: interpreter.SIGN}

#: The sign of a difference is phi2 of the paper, the most frequent of all functions.
_SIGNS = {SUB: interpreter.SIGN_OF_DIFFERENCE, MUL: interpreter.SIGN_OF_PRODUCT}

Term = Regressor | Expression


class TermPool:
    """Hash-consed canonical expressions: a node for every subexpression, a term for every regressor.

    The numbers follow the order of arrival, so nothing that is a result may depend on them.
    """

    def __init__(self) -> None:
        self._numbers: dict[tuple[int, int, int, int, float], int] = {}
        self._known: dict[Expression, int] = {}
        self._terms: dict[Expression, int] = {}
        #: The deepest lag of every channel that anything reads.
        self.deepest: dict[int, int] = {}
        #: Rows of these arrays that nobody has taken are room to grow.
        self.nodes = _room(256, 256)

    def __len__(self) -> int:
        return len(self._terms)

    def term(self, term: Term) -> int:
        """Return the number of a regressor, or of a bare canonical expression."""
        expression = term.expression if isinstance(term, Regressor) else term
        known = self._terms.get(expression)
        if known is not None:
            return known
        product = isinstance(expression, Apply) and expression.primitive == MUL
        parts = expression.arguments if isinstance(expression, Apply) and product else (expression,)
        factors = [self._node(part) for part in parts]
        while len(factors) > MAX_FACTORS:
            factors[:2] = [self._add(MULTIPLY, factors[0], factors[1])]
        number = len(self._terms)
        if number == self.nodes.degree.size:
            self.nodes = _grown(self.nodes, terms=2 * number)
        self.nodes.factors[number, : len(factors)] = factors
        self.nodes.degree[number] = len(factors)
        self._terms[expression] = number
        return number

    def terms(self, terms: Sequence[Term]) -> NDArray[np.int64]:
        """Return the numbers of several."""
        return np.array([self.term(term) for term in terms], np.int64)

    def _node(self, expression: Expression) -> int:
        known = self._known.get(expression)
        if known is None:
            known = self._known[expression] = self._made(expression)
        return known

    def _made(self, expression: Expression) -> int:
        match expression:
            case Lagged(channel, lag):
                self.deepest[channel] = max(lag, self.deepest.get(channel, 0))
                return self._add(LAGGED, channel, lag)
            case Constant(value):
                return self._add(CONSTANT, value=value)
            case Apply(primitive, (Apply(inner, (*firsts, last)),)) if primitive == SIGN and inner in _SIGNS:
                first = firsts[0] if len(firsts) == 1 else Apply(inner, tuple(firsts))
                return self._add(_SIGNS[inner], self._node(first), self._node(last))
            case Apply(primitive, (first, *others)) if primitive in _OPERATIONS:
                result = self._node(first)
                if not others:
                    return self._add(_OPERATIONS[primitive], result, result)
                for other in others:
                    operation, operand = _operation(primitive, other)
                    result = self._add(operation, result, self._node(operand))
                return result
        assert isinstance(expression, Apply), "a canonical expression has its back-shifts at the leaves"
        arguments = [self._node(argument) for argument in expression.arguments]
        return self._add(CALL, arguments[0], arguments[-1], row_address(expression.primitive))

    def _add(
        self, operation: int, first: int = 0, second: int = 0, address: int = 0, value: float = 0.0
    ) -> int:
        key = (operation, first, second, address, value)
        known = self._numbers.get(key)
        if known is not None:
            return known
        number = self._numbers[key] = len(self._numbers)
        if number == self.nodes.operation.size:
            self.nodes = _grown(self.nodes, nodes=2 * number)
        for column, entry in zip(self.nodes, key, strict=False):
            column[number] = entry
        return number


def _operation(primitive: Primitive, operand: Expression) -> tuple[int, Expression]:
    """Return the instruction that takes an operand in, and what is left of the operand."""
    match primitive, operand:
        case _, Apply(inner, (Constant(-1.0), *rest)) if primitive == ADD and inner == MUL:
            # Canonical form writes a - b + c as a + (-1)*b + c; a difference has the same bits.
            return interpreter.SUBTRACT, rest[0] if len(rest) == 1 else Apply(MUL, tuple(rest))
    return _OPERATIONS[primitive], operand


def _room(nodes: int, terms: int) -> NodeArrays:
    operation, first, second, address = np.zeros((4, nodes), np.int64)
    factors, degree = np.zeros((terms, MAX_FACTORS), np.int64), np.zeros(terms, np.int64)
    return NodeArrays(operation, first, second, address, np.zeros(nodes), factors, degree)


def _grown(old: NodeArrays, nodes: int = 0, terms: int = 0) -> NodeArrays:
    new = _room(nodes or old.operation.size, terms or old.degree.size)
    for column, before in zip(new, old, strict=True):
        column[: len(before)] = before
    return new


def link(terms: Sequence[Term]) -> Program:
    """Link regressors, one term each and in the order given.

    A term may also be a bare canonical expression of lag 0, the target y(k) for instance: the kernel of
    columns allows it, a simulation does not.
    """
    store = TermPool()
    numbers = store.terms(terms)
    nodes = store.nodes
    program: Program = codegen.generate_program(nodes, numbers, np.full(nodes.operation.size, -1, np.int64))
    return program
