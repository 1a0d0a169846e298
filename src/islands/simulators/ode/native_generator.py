"""Generator of the machine code of a program: a loop over the samples whose rows are values."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from llvmlite import binding, ir

from islands.kernels.interpreter import ADD, MULTIPLY, SIGN, SUBTRACT
from islands.simulators.ode import kernel as ode_kernel

_DOUBLE, _PLACE = ir.DoubleType(), ir.IntType(32)

#: Name under which Numba gives the exponential of the C library to its kernels, such as the interpreter.
EXPONENTIAL = "numba_exp"

#: Name of the function.
FUNCTION = "integrate"

_INTEGER = ir.IntType(64)
_POINTER = _DOUBLE.as_pointer()


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


class ProgramCode(NamedTuple):
    """What the machine code of a program depends on.

    Attributes
    ----------
    code : bytes
        Instructions, of int64.
    ends, signals, slopes, outputs : tuple of int
        See `Instructions`.
    states : int
        Row of the first state.
    shared : int
        Number of signals that are equal in all lanes.
    receivers : tuple of int or None
        Receivers of `LaneLimits`; None for states without limits.
    is_spilling : bool
        Whether receivers get a part of what the upper limits cut off.
    restarted : int
        Number of states that are set to given values at regular intervals.
    is_moving : bool
        Whether each restart has its own places of signals.
    lanes : int
        Number of lanes.
    """

    code: bytes
    ends: tuple[int, ...]
    signals: tuple[int, ...]
    slopes: tuple[int, ...]
    outputs: tuple[int, ...]
    states: int
    shared: int
    receivers: tuple[int, ...] | None
    is_spilling: bool
    restarted: int
    is_moving: bool
    lanes: int


class NativeGenerator:
    """Generator of the function that integrates a program.

    The arguments are those of `NativeCode.integrate`: sizes, the step, and addresses of arrays.
    """

    def __init__(self, program: ProgramCode) -> None:
        self._program = program
        self._code = np.frombuffer(program.code, dtype=np.int64).reshape(-1, 5).tolist()
        self._module = ir.Module()
        self._module.triple = binding.get_default_triple()
        arguments = [*[_INTEGER] * 5, _DOUBLE, *[_POINTER] * 9]
        function = ir.Function(self._module, ir.FunctionType(ir.VoidType(), arguments), FUNCTION)
        sizes, self._dt, pointers = function.args[:5], function.args[5], function.args[6:]
        self._samples, self._every, self._interval, self._own_count, self._width = sizes
        self._arena, self._shared, self._own, self._places, *limits, self._restarts, self._out = pointers
        self._lower, self._upper, self._caught = limits
        self._blocks = [function.append_basic_block(name) for name in ("entry", "loop", "advance", "end")]
        self._build = ir.IRBuilder(self._blocks[0])
        self._lanes, self._row = program.lanes, RowOperations(self._build, program.lanes)
        self._rows: dict[int, Any] = {}

    def generate(self) -> ir.Module:
        """Return the module that contains the function."""
        program, build = self._program, self._build
        entry, loop, advance, end = self._blocks
        for row in set(range(program.states)) - set(program.signals):
            self._rows[row] = self._row.load(self._arena, self._lanes * row)
        self._execute(0, program.ends[0])
        count = len(program.slopes)
        starts = [self._row.load(self._arena, self._lanes * (program.states + i)) for i in range(count)]
        limits = [
            [self._row.load(limit, self._lanes * i) for i in range(count)] if used else []
            for limit, used in (
                (self._lower, program.receivers is not None),
                (self._upper, program.receivers is not None),
                (self._caught, program.is_spilling),
            )
        ]
        own_places = [] if program.is_moving else self._load_places(_INTEGER(0))
        build.branch(loop)

        build.position_at_end(loop)
        sample = build.phi(_INTEGER, name="sample")
        sample.add_incoming(_INTEGER(0), entry)
        carried = [build.phi(start.type) for start in starts]
        for phi, start in zip(carried, starts, strict=True):
            phi.add_incoming(start, entry)
        before = [*self._restart(carried[: program.restarted], sample), *carried[program.restarted :]]
        own_sample = sample
        if program.is_moving:
            own_sample = build.urem(sample, self._interval)
            own_places = self._load_places(build.udiv(sample, self._interval))
        read_signals = partial(self._read_signals, sample, own_sample, own_places)
        read_signals(0)
        slopes = self._differentiate(before, program.ends[0])
        self._write_outputs(sample)
        following = build.add(sample, _INTEGER(1))
        build.cbranch(build.icmp_unsigned("<", following, self._samples), advance, end)

        build.position_at_end(advance)
        new = self._limit(self._advance(before, slopes, read_signals), *limits)
        sample.add_incoming(following, build.block)
        for phi, value in zip(carried, new, strict=True):
            phi.add_incoming(value, build.block)
        build.branch(loop)

        build.position_at_end(end)
        for index, value in enumerate(before):
            self._row.store(value, self._arena, self._lanes * (program.states + index))
        build.ret_void()
        return self._module

    def _advance(
        self, states: list[Any], slopes: list[Any], read_signals: Callable[[int], None]
    ) -> list[Any]:
        """Return the states at the next sample, by RK4, given the derivatives at this one."""
        build, total = self._build, slopes
        half, sixth = self._scale(0.5), self._row.fill(build.fdiv(self._dt, _DOUBLE(6.0)))
        for stage in (1, 2, 3):
            part = half if stage < 3 else self._scale(1.0)
            moved = [build.fadd(x, build.fmul(part, slope)) for x, slope in zip(states, slopes, strict=True)]
            if stage != 2:  # the signals in the middle of the step are known
                read_signals((stage + 1) // 2)
            slopes = self._differentiate(moved, self._program.ends[1 if stage == 2 else 0])
            if stage < 3:
                twice = (build.fmul(self._row.constant(2.0), slope) for slope in slopes)
                total = [build.fadd(x, slope) for x, slope in zip(total, twice, strict=True)]
        return [
            build.fadd(x, build.fmul(sixth, build.fadd(sum_, slope)))
            for x, sum_, slope in zip(states, total, slopes, strict=True)
        ]

    def _restart(self, states: list[Any], sample: Any) -> list[Any]:
        """Return the states of a sample; the first one of an interval has given states."""
        build, size = self._build, _INTEGER(self._lanes * len(states))
        is_first = build.icmp_unsigned("==", build.urem(sample, self._interval), _INTEGER(0))
        place = build.mul(build.udiv(sample, self._interval), size)
        given = [
            self._row.load(self._restarts, build.add(place, _INTEGER(self._lanes * i)))
            for i in range(len(states))
        ]
        return [build.select(is_first, *pair) for pair in zip(given, states, strict=True)]

    def _execute(self, begin: int, end: int) -> None:
        for operation, target, *operands in self._code[begin:end]:
            # Rows that an operation does not read may not be known.
            known = [self._rows.get(row) for row in operands]
            self._rows[target] = self._row.execute(operation, *known)

    def _differentiate(self, states: list[Any], begin: int) -> list[Any]:
        """Return the derivatives, given the states; ``begin`` is the first instruction."""
        self._rows.update(enumerate(states, start=self._program.states))
        self._execute(begin, self._program.ends[2])
        return [self._rows[row] for row in self._program.slopes]

    def _scale(self, factor: float) -> Any:
        return self._row.fill(self._build.fmul(self._dt, _DOUBLE(factor)))

    def _load_places(self, restart: Any) -> list[list[Any]]:
        """Return the place of each own signal in each lane."""
        build, own = self._build, len(self._program.signals) - self._program.shared
        integers = build.bitcast(self._places, _INTEGER.as_pointer())
        first = build.mul(restart, _INTEGER(self._lanes * own))
        return [
            [
                build.load(build.gep(integers, [build.add(first, _INTEGER(self._lanes * index + lane))]))
                for lane in range(self._lanes)
            ]
            for index in range(own)
        ]

    def _read_signals(self, sample: Any, own_sample: Any, own_places: list[list[Any]], moment: int) -> None:
        build, shared = self._build, self._program.shared
        moments, own_moments = (
            build.add(build.mul(each, _INTEGER(3)), _INTEGER(moment)) for each in (sample, own_sample)
        )
        first = build.mul(moments, _INTEGER(shared))
        for index, row in enumerate(self._program.signals[:shared]):
            place = build.gep(self._shared, [build.add(first, _INTEGER(index))])
            self._rows[row] = self._row.fill(build.load(place))
        first = build.mul(own_moments, self._own_count)
        for places, row in zip(own_places, self._program.signals[shared:], strict=True):
            self._rows[row] = self._row.gather(self._own, [build.add(first, place) for place in places])

    def _write_outputs(self, sample: Any) -> None:
        build, program, known = self._build, self._program, dict(self._rows)
        is_read = build.icmp_unsigned("==", build.urem(sample, self._every), _INTEGER(0))
        with build.if_then(is_read):
            self._execute(program.ends[2], program.ends[3])
            first = build.mul(build.udiv(sample, self._every), _INTEGER(len(program.outputs)))
            for index, row in enumerate(program.outputs):
                place = build.mul(build.add(first, _INTEGER(index)), self._width)
                self._row.store(self._rows[row], self._out, place)
        self._rows = known

    def _limit(self, states: list[Any], lower: list[Any], upper: list[Any], caught: list[Any]) -> list[Any]:
        """Limit states; a NaN remains. Receivers get a part of what upper limits cut off."""
        build, limited = self._build, list(states)
        for index, part in enumerate(caught):
            assert self._program.receivers is not None
            receiver = self._program.receivers[index]
            over = build.fmul(part, build.fsub(limited[index], upper[index]))
            is_over = build.fcmp_ordered(">", limited[index], upper[index])
            added = build.fadd(limited[receiver], over)
            limited[receiver] = build.select(is_over, added, limited[receiver])
        for index, (low, high) in enumerate(zip(lower, upper, strict=True)):
            value = limited[index]
            clipped = build.select(build.fcmp_ordered(">", value, high), high, value)
            limited[index] = build.select(build.fcmp_ordered("<", value, low), low, clipped)
        return limited
