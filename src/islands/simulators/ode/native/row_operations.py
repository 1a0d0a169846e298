"""Generator of machine code for rows: values of all lanes, as LLVM vectors."""

from collections.abc import Sequence
from typing import Any

from llvmlite import ir

from islands.kernels.interpreter import ADD, MULTIPLY, SIGN, SUBTRACT
from islands.simulators.ode import kernel as ode_kernel

_DOUBLE = ir.DoubleType()
_PLACE = ir.IntType(32)

#: Name under which Numba gives the exponential of the C library to its kernels, such as the interpreter.
EXPONENTIAL = "numba_exp"


class RowOperations:
    """Operations on rows at the position of a builder; the instructions are those of the kernel.

    Parameters
    ----------
    build : IRBuilder
    lanes : int
        Number of lanes.
    """

    def __init__(self, build: ir.IRBuilder, lanes: int) -> None:
        self._build, self._lanes = build, lanes
        self._type = ir.VectorType(_DOUBLE, lanes)
        self._undefined = ir.Constant(self._type, ir.Undefined)

    def constant(self, number: float) -> ir.Constant:
        """Return a row with a number in all lanes."""
        return ir.Constant(self._type, [number] * self._lanes)

    def fill(self, number: Any) -> Any:
        """Return a row with a computed number in all lanes."""
        first = self._build.insert_element(self._undefined, number, _PLACE(0))
        same = ir.Constant(ir.VectorType(_PLACE, self._lanes), [0] * self._lanes)
        return self._build.shuffle_vector(first, self._undefined, same)

    def load(self, array: Any, place: Any) -> Any:
        """Read a row from a place of an array."""
        row = self._build.load(self._point(array, place))
        row.align = 8
        return row

    def store(self, row: Any, array: Any, place: Any) -> None:
        """Write a row to a place of an array."""
        self._build.store(row, self._point(array, place)).align = 8

    def _point(self, array: Any, place: Any) -> Any:
        place = ir.IntType(64)(place) if isinstance(place, int) else place
        return self._build.bitcast(self._build.gep(array, [place]), self._type.as_pointer())

    def gather(self, array: Any, places: Sequence[Any]) -> Any:
        """Read the value of each lane from its own place."""
        row = self._undefined
        for lane, place in enumerate(places):
            value = self._build.load(self._build.gep(array, [place]))
            row = self._build.insert_element(row, value, _PLACE(lane))
        return row

    def execute(self, operation: int, a: Any, b: Any, c: Any) -> Any:
        """Return the result of an instruction."""
        build = self._build
        if operation == MULTIPLY:
            return build.fmul(a, b)
        if operation == ADD:
            return build.fadd(a, b)
        if operation == SUBTRACT:
            return build.fsub(a, b)
        if operation == ode_kernel.ADD_PRODUCT:
            return build.fadd(a, build.fmul(b, c))
        if operation == ode_kernel.SUBTRACT_PRODUCT:
            return build.fsub(a, build.fmul(b, c))
        if operation == ode_kernel.DIVIDE:
            return build.fdiv(a, b)
        if operation == ode_kernel.COPY:
            return a
        if operation == SIGN:
            negative = self._select("<", a, self.constant(0.0), self.constant(-1.0), self.constant(0.0))
            return self._select(">", a, self.constant(0.0), self.constant(1.0), negative)
        if operation == ode_kernel.SQUARE_ROOT:
            return self._call("sqrt", a)
        if operation == ode_kernel.ABSOLUTE:
            return self._call("fabs", a)
        if operation == ode_kernel.NEGATE:
            return build.fneg(a)
        if operation == ode_kernel.MINIMUM:
            return self._select("<", a, b, a, b)
        if operation == ode_kernel.MAXIMUM:
            return self._select("<", b, a, a, b)
        if operation in (ode_kernel.LESS, ode_kernel.LESS_EQUAL):
            comparison = "<" if operation == ode_kernel.LESS else "<="
            return self._select(comparison, a, b, self.constant(1.0), self.constant(0.0))
        if operation == ode_kernel.EXPONENTIAL:
            return self._call_lanes(EXPONENTIAL, a)
        assert operation == ode_kernel.SELECT
        return self._select(">", a, self.constant(0.0), b, c)

    def _select(self, comparison: str, a: Any, b: Any, first: Any, second: Any) -> Any:
        return self._build.select(self._build.fcmp_ordered(comparison, a, b), first, second)

    def _call(self, name: str, row: Any) -> Any:
        """Call LLVM's function of this name for all lanes."""
        full, module = f"llvm.{name}.v{self._lanes}f64", self._build.module
        function = module.globals.get(full)
        if function is None:
            function = ir.Function(module, ir.FunctionType(self._type, [self._type]), full)
        return self._build.call(function, [row])

    def _call_lanes(self, name: str, row: Any) -> Any:
        """Call a function of the C library for each lane."""
        build, module, result = self._build, self._build.module, self._undefined
        function = module.globals.get(name)
        if function is None:
            function = ir.Function(module, ir.FunctionType(_DOUBLE, [_DOUBLE]), name)
            for attribute in ("nounwind", "readnone"):
                function.attributes.add(attribute)
        for lane in range(self._lanes):
            value = build.call(function, [build.extract_element(row, _PLACE(lane))])
            result = build.insert_element(result, value, _PLACE(lane))
        return result
