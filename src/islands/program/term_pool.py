"""Pool of expressions as nodes and terms with integer indices, from which the kernels generate programs."""

from collections.abc import Sequence
from threading import local

import numpy as np
from numpy.typing import NDArray

from islands.expressions.primitives import ADD, MUL, PRIMITIVES, SIGN, SUB
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Primitive, Symbol, walk
from islands.kernels import codegen, interpreter
from islands.kernels.codegen import CONSTANT, LAGGED, NodeArrays
from islands.kernels.interpreter import CALL, MAX_FACTORS, MULTIPLY, Program
from islands.models.regressor import Regressor
from islands.program.primitive_functions import row_address

#: Primitives that are instructions of the interpreter; all others are called through an address.
_OPERATIONS = {ADD: interpreter.ADD, SUB: interpreter.SUBTRACT, MUL: MULTIPLY, SIGN: interpreter.SIGN}

#: Instructions for the sign of a result. The sign of a difference is phi2 of the paper, the most frequent
#: function.
_SIGNS = {SUB: interpreter.SIGN_OF_DIFFERENCE, MUL: interpreter.SIGN_OF_PRODUCT}

#: Largest number of nodes, and of terms, of the pool of recent terms.
_MOST_NODES = 4096

Term = Regressor | Expression


class TermPool:
    """Hash-consed canonical expressions: a node for every subexpression, a term for every regressor.

    The indices follow the order of insertion; no result may depend on them.

    Parameters
    ----------
    parameters : sequence of str
        Names of parameters in the expressions.
    """

    def __init__(self, parameters: Sequence[str] = ()) -> None:
        self._parameters = {name: number for number, name in enumerate(parameters, start=1)}
        self._indices: dict[tuple[int, int, int, int, float], int] = {}
        self._known: dict[Expression, int] = {}
        self._terms: dict[Expression, int] = {}
        #: Largest lag of every channel that an expression reads.
        self.deepest: dict[int, int] = {}
        #: Arrays of nodes and terms; unused elements at the end are reserve.
        self.nodes = _allocate_nodes(256, 256)
        self._operand_index = np.full(256, -1, np.int64)

    def __len__(self) -> int:
        return len(self._terms)

    def term(self, term: Term) -> int:
        """Return the index of a regressor or canonical expression; add it if it is new."""
        expression = term.expression if isinstance(term, Regressor) else term
        known = self._terms.get(expression)
        if known is not None:
            return known
        product = isinstance(expression, Apply) and expression.primitive == MUL
        parts = expression.arguments if isinstance(expression, Apply) and product else (expression,)
        factors = [self._node(part) for part in parts]
        while len(factors) > MAX_FACTORS:
            factors[:2] = [self._add(MULTIPLY, factors[0], factors[1])]
        index = len(self._terms)
        if index == self.nodes.degree.size:
            self.nodes = _grow(self.nodes, terms=2 * index)
        self.nodes.factors[index, : len(factors)] = factors
        self.nodes.degree[index] = len(factors)
        self._terms[expression] = index
        return index

    def terms(self, terms: Sequence[Term]) -> NDArray[np.int64]:
        """Return the indices of several terms."""
        return np.array([self.term(term) for term in terms], np.int64)

    def generate(self, terms: NDArray[np.int64]) -> Program:
        """Generate the program of some terms, given by their indices."""
        if self._operand_index.size != self.nodes.operation.size:
            self._operand_index = np.full(self.nodes.operation.size, -1, np.int64)
        program: Program = codegen.generate_program(self.nodes, terms, self._operand_index)
        return program

    def _node(self, expression: Expression) -> int:
        known = self._known.get(expression)
        if known is None:
            known = self._known[expression] = self._make_node(expression)
        return known

    def _make_node(self, expression: Expression) -> int:
        match expression:
            case Lagged(channel, lag):
                self.deepest[channel] = max(lag, self.deepest.get(channel, 0))
                return self._add(LAGGED, channel, lag)
            case Constant(value):
                return self._add(CONSTANT, value=value)
            case Symbol(name):
                return self._add(CONSTANT, self._parameters[name])
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
        known = self._indices.get(key)
        if known is not None:
            return known
        index = self._indices[key] = len(self._indices)
        if index == self.nodes.operation.size:
            self.nodes = _grow(self.nodes, nodes=2 * index)
        for column, entry in zip(self.nodes, key, strict=False):
            column[index] = entry
        return index


def _operation(primitive: Primitive, operand: Expression) -> tuple[int, Expression]:
    """Return the instruction that combines an operand with the result so far, and the operand it reads."""
    match primitive, operand:
        case _, Apply(inner, (Constant(-1.0), *rest)) if primitive == ADD and inner == MUL:
            # Canonical form is a + (-1)*b + c for a - b + c; a difference has the same bits.
            return interpreter.SUBTRACT, rest[0] if len(rest) == 1 else Apply(MUL, tuple(rest))
    return _OPERATIONS[primitive], operand


def _allocate_nodes(nodes: int, terms: int) -> NodeArrays:
    operation, first, second, address = np.zeros((4, nodes), np.int64)
    factors, degree = np.zeros((terms, MAX_FACTORS), np.int64), np.zeros(terms, np.int64)
    return NodeArrays(operation, first, second, address, np.zeros(nodes), factors, degree)


def _grow(old: NodeArrays, nodes: int = 0, terms: int = 0) -> NodeArrays:
    new = _allocate_nodes(nodes or old.operation.size, terms or old.degree.size)
    for column, before in zip(new, old, strict=True):
        column[: len(before)] = before
    return new


class _RecentTerms(local):
    """Pool of the terms of recent programs of a thread, which finds a term by its identity.

    A search simulates thousands of models over a few hundred regressors. The program of a model does not
    depend on the other terms of its pool.
    """

    def __init__(self) -> None:
        self._clear()

    def _clear(self) -> None:
        self.pool = TermPool()
        # The terms are kept, so that no other object has their identity.
        self._known: dict[int, tuple[Term, int]] = {}

    def find(self, terms: Sequence[Term]) -> NDArray[np.int64] | None:
        """Return the indices of terms in the pool; None if one of them may not be in it."""
        if max(len(self._known), self.pool.nodes.operation.size) > _MOST_NODES:
            self._clear()
        found = np.empty(len(terms), np.int64)
        for place, term in enumerate(terms):
            known = self._known.get(id(term))
            if known is None:
                expression = term.expression if isinstance(term, Regressor) else term
                if not all(map(_is_shareable, walk(expression))):
                    return None
                known = self._known[id(term)] = (term, self.pool.term(expression))
            found[place] = known[1]
        return found


_RECENT = _RecentTerms()


def _is_shareable(node: Expression) -> bool:
    """Return whether equal nodes have equal bits: functions of one name may differ, and 0 equals -0."""
    match node:
        case Apply(primitive, _):
            entry = PRIMITIVES.get(primitive.name)
            return entry is not None and entry.scalar is primitive.scalar
        case Constant(value):
            return value != 0.0
    return isinstance(node, Lagged)


def link(terms: Sequence[Term], parameters: Sequence[str] = ()) -> Program:
    """Generate the program of some regressors, one term each and in the given order.

    A term may also be a canonical expression with lag 0, for example the target y(k). The kernel of columns
    allows this, a simulation does not. ``parameters`` are the names of parameters in the expressions.
    """
    shared = None if parameters else _RECENT.find(terms)
    if shared is not None:
        return _RECENT.pool.generate(shared)
    pool = TermPool(parameters)
    return pool.generate(pool.terms(terms))
