"""Translation of expressions to the flat programs that the kernels execute.

A primitive's scalar function is compiled for a whole row and called through its address: the interpreter does
not depend on the table of primitives, and a user-defined function is as fast as a built-in one. The kernels
generate programs from the nodes and terms of a `TermPool`; `regressor_matrix` evaluates them on a record.
"""

from collections.abc import Sequence
from functools import cache, lru_cache
from threading import local
from typing import Any

import numpy as np
from numba import types
from numba.core.errors import NumbaError
from numba.extending import register_jitable
from numpy.typing import NDArray

from islands.errors import ModelError, RecordError, SettingsError
from islands.expressions.primitives import ADD, MUL, PRIMITIVES, SIGN, SUB
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Primitive, Symbol, walk
from islands.kernels import codegen, interpreter
from islands.kernels import gram as gram_kernel
from islands.kernels import regressor_columns as column_kernel
from islands.kernels.codegen import CONSTANT, LAGGED, NodeArrays
from islands.kernels.interpreter import CALL, MAX_FACTORS, MULTIPLY, Program
from islands.kernels.jit_cache import compile_callback
from islands.kernels.regressor_columns import LANES, TIMES, Rows
from islands.kernels.simd import padded_size
from islands.models.regressor import Regressor
from islands.records.dataset import Dataset

_ROW = types.CPointer(types.float64)
_SIGNATURE = types.void(_ROW, _ROW, _ROW, types.int64)

#: Primitives that are instructions of the interpreter; all others are called through an address.
_OPERATIONS = {ADD: interpreter.ADD, SUB: interpreter.SUBTRACT, MUL: MULTIPLY, SIGN: interpreter.SIGN}

#: Instructions for the sign of a result. The sign of a difference is phi2 of the paper, the most frequent
#: function.
_SIGNS = {SUB: interpreter.SIGN_OF_DIFFERENCE, MUL: interpreter.SIGN_OF_PRODUCT}

#: Largest number of nodes, and of terms, of the pool of recent terms.
_MOST_NODES = 4096

Term = Regressor | Expression


def row_address(primitive: Primitive) -> int:
    """Return the machine address of ``void (double *target, double *first, double *second, int64 lanes)``.

    Raises
    ------
    ModelError
        The scalar function does not compile.
    """
    return int(_compile(primitive.scalar, primitive.arity, primitive.name).address)


@cache
def _compile(scalar: Any, arity: int, name: str) -> Any:
    scalar = register_jitable(scalar)

    def unary(target: Any, first: Any, _second: Any, lanes: Any) -> None:
        for lane in range(lanes):
            target[lane] = scalar(first[lane])

    def binary(target: Any, first: Any, second: Any, lanes: Any) -> None:
        for lane in range(lanes):
            target[lane] = scalar(first[lane], second[lane])

    try:
        return compile_callback(unary if arity == 1 else binary, _SIGNATURE)
    except NumbaError as error:
        raise ModelError(
            f"primitive {name!r} does not compile; use arithmetic, comparisons and math alone: {error}"
        ) from error


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


def regressor_matrix(terms: Sequence[Term], record: Dataset, warm_up: int) -> NDArray[np.float64]:
    """Return Psi transposed, shape (terms, rows): each term on every row after the warm-up of every segment.

    A term may be a canonical expression, which may have lag 0: the target y(k) is ``Lagged(0, 0)``.

    Raises
    ------
    RecordError
        If an output is missing, if no segment is longer than the warm-up, or if a term reads an input that
        the record does not have.
    SettingsError
        If the warm-up is shorter than the largest lag of the terms.
    """
    program = link(terms)
    _check_readable(program, record, warm_up)
    rows = select_rows(record, warm_up)
    out = np.empty((len(terms), rows.count))
    column_kernel.columns(program, rows, out)
    return out


def gram_matrix(terms: Sequence[Term], record: Dataset, warm_up: int) -> NDArray[np.float64]:
    """Return the inner products of all pairs of terms, shape (terms, terms), without storing the columns.

    Raises
    ------
    RecordError, SettingsError
        As in `regressor_matrix`.
    """
    program = link(terms)
    _check_readable(program, record, warm_up)
    out = np.empty((len(terms), len(terms)))
    gram_kernel.gram(program, select_rows(record, warm_up), out)
    return out


def _check_readable(program: Program, record: Dataset, warm_up: int) -> None:
    # The kernel has no bounds checks: it would read another signal, or memory outside the record.
    read = program.operands[program.operands[:, 0] >= 0]
    channel, lag = read.max(axis=0, initial=0)
    if channel > record.inputs:
        raise RecordError(f"the terms read input {channel}, the record has {record.inputs}")
    if lag > warm_up:
        raise SettingsError(f"the terms read {lag} samples back, the warm-up has {warm_up}")


# The rows of recent calls are kept: a selection estimates many models on few records, which never change.
@lru_cache(maxsize=8)
def select_rows(record: Dataset, warm_up: int) -> Rows:
    """Return the rows that are used for the estimation: those of every segment after its warm-up.

    Raises
    ------
    RecordError
        If an output is missing, or if no segment is longer than the warm-up.
    """
    missing = np.flatnonzero(np.isnan(record.y))
    if missing.size:
        raise RecordError(
            f"{record.output_name} is missing at sample {missing[0]}: estimation needs every sample, "
            "cut the record there and pass the parts as segments"
        )
    spans = [
        (begin + warm_up, end - begin - warm_up) for begin, end in record.bounds if end - begin > warm_up
    ]
    if not spans:
        raise RecordError(
            f"the longest recording has {max(record.segments)} samples and {warm_up} are needed before the "
            "first row: take a longer recording or smaller lags"
        )
    return arrange_rows(np.vstack([record.y, record.u.T]), spans, warm_up)


def arrange_rows(signals: NDArray[np.float64], spans: Sequence[tuple[int, int]], warm_up: int) -> Rows:
    """Arrange signals in chunks of times and lanes; see `Rows` for the layout.

    Parameters
    ----------
    signals : ndarray, shape (channel, sample)
    spans : sequence of pairs of int
        Sample of the first row and number of rows of every segment.
    warm_up : int
        Number of samples before each first row that may be read.
    """
    samples, chunks = [], []
    flat = count = 0
    for first, rows in spans:
        length = -(-rows // LANES)
        times = -(-length // TIMES) * TIMES
        time, lane = np.arange(times), np.arange(LANES)
        samples.append(first + np.arange(-warm_up, times)[:, None] + length * lane)
        begin = flat + (warm_up + time[::TIMES]) * LANES
        full = np.where(time < length, -(-(rows - time) // length), 0).reshape(-1, TIMES)
        chunks.append((begin, full, (count + time).reshape(-1, TIMES), np.full(begin.size, length)))
        flat, count = flat + (warm_up + times) * LANES, count + rows
    # Samples after the last row of a segment are read, but never counted.
    places = np.minimum(np.concatenate(samples), signals.shape[1] - 1).reshape(-1)
    gathered = padded_size(len(signals) * flat).reshape(-1, flat)
    gathered[:] = signals[:, places]
    offset, lanes, row, apart = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
    return Rows(gathered, offset, lanes, row, apart, count)
