"""Machine code of a program: what the kernel interprets, with states and intermediate results in registers.

An interpreted instruction waits for the result of the one before in memory. Machine code needs a quarter of
the time, but some milliseconds of compilation, so that only programs that run often are compiled. It executes
the same operations in the same order without contraction, so that every bit is that of the interpreter.
Programs that call functions of the C library or force laws, and runs that are restarted, remain interpreted.
"""

import ctypes
from collections import OrderedDict
from functools import lru_cache
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from llvmlite import binding, ir
from numpy.typing import NDArray

from islands.systems.ode import ode_kernel
from islands.systems.ode.kernel_arguments import LANES, Instructions, LaneLimits, LaneSignals
from islands.systems.ode.row_operations import RowOperations

#: Interpreted steps after which a program is compiled: they take as long as the compilation.
COMPILED_FROM_STEPS = 100_000

#: Largest number of instructions of a compiled program; the time of a compilation grows with it.
MAX_INSTRUCTIONS = 300

#: Number of programs whose steps are counted, and of those whose machine code is kept, about 1 MB each.
_COUNTED, _KEPT = 256, 64

#: Name of the function.
_NAME = "integrate"

_DOUBLE, _INTEGER = ir.DoubleType(), ir.IntType(64)
_POINTER = _DOUBLE.as_pointer()

_counts: OrderedDict["ProgramCode", int] = OrderedDict()
_lock = Lock()


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


class NativeCode:
    """Machine code of a program.

    Parameters
    ----------
    program : ProgramCode
    """

    def __init__(self, program: ProgramCode) -> None:
        self._states = slice(program.states, program.states + len(program.slopes))
        machine = _make_machine()
        module = binding.parse_assembly(str(_Generator(program).generate()))
        options = binding.create_pipeline_tuning_options(speed_level=1)
        builder = binding.create_pass_builder(machine, options)
        builder.getModulePassManager().run(module, builder)
        self._engine = binding.create_mcjit_compiler(module, machine)
        self._engine.finalize_object()
        integers, pointers = [ctypes.c_int64] * 4, [ctypes.c_void_p] * 8
        signature = ctypes.CFUNCTYPE(None, *integers, ctypes.c_double, *pointers)
        self._function = signature(self._engine.get_function_address(_NAME))

    def integrate(
        self,
        arena: NDArray[np.float64],
        signals: LaneSignals,
        dt: float,
        limits: LaneLimits,
        lanes: int,
        first: int,
        every: int,
        out: NDArray[np.float64],
    ) -> None:
        """Integrate as `ode_kernel.integrate`, without restarts and force laws."""
        arrays = (
            *(arena, signals.shared, signals.own, signals.places),
            *(limits.lower, limits.upper, limits.caught, out[:, :, first:]),
        )
        sizes = signals.shared.shape[0], every, signals.own.shape[2], out.shape[2]
        self._function(*sizes, dt, *(each.ctypes.data for each in arrays))
        is_finite = np.isfinite(arena.reshape(-1, LANES)[self._states, :lanes]).all(axis=0)
        out[:, :, first : first + lanes][:, :, ~is_finite] = np.nan


def find_native_code(
    instructions: Instructions, signals: LaneSignals, limits: LaneLimits
) -> NativeCode | None:
    """Return the machine code of a program that runs often, and count the steps of others."""
    if not _is_supported(instructions):
        return None
    program = ProgramCode(
        code=instructions.code.tobytes(),
        ends=tuple(instructions.ends.tolist()),
        signals=tuple(instructions.signals.tolist()),
        slopes=tuple(instructions.slopes.tolist()),
        outputs=tuple(instructions.outputs.tolist()),
        states=instructions.states,
        shared=signals.shared.shape[2],
        receivers=tuple(limits.receivers.tolist()) if limits.lower.size else None,
        is_spilling=limits.caught.size > 0,
    )
    with _lock:
        steps = _counts.pop(program, 0)
        _counts[program] = steps + signals.shared.shape[0]
        while len(_counts) > _COUNTED:
            _counts.popitem(last=False)
        return _compile(program) if steps >= COMPILED_FROM_STEPS else None


def _is_supported(instructions: Instructions) -> bool:
    """Return whether a program is short, and calls no function of the C library and no force laws."""
    operations = instructions.code[:, 0]
    return operations.size <= MAX_INSTRUCTIONS and not (operations >= ode_kernel.POWER).any()


@lru_cache(maxsize=_KEPT)
def _compile(program: ProgramCode) -> NativeCode:
    return NativeCode(program)


def _make_machine() -> Any:
    """Return a new description of this processor: each execution engine takes ownership of one."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=2
    )


class _Generator:
    """Generator of the function that integrates a program; rows are values of the loop over the samples."""

    def __init__(self, program: ProgramCode) -> None:
        self._program = program
        self._code = np.frombuffer(program.code, dtype=np.int64).reshape(-1, 5).tolist()
        self._module = ir.Module()
        self._module.triple = binding.get_default_triple()
        arguments = [*[_INTEGER] * 4, _DOUBLE, *[_POINTER] * 8]
        function = ir.Function(self._module, ir.FunctionType(ir.VoidType(), arguments), _NAME)
        self._samples, self._every, self._own_count, self._width, self._dt, *pointers = function.args
        self._arena, self._shared, self._own, self._places, *limits, self._out = pointers
        self._lower, self._upper, self._caught = limits
        self._blocks = [function.append_basic_block(name) for name in ("entry", "loop", "advance", "end")]
        self._build = ir.IRBuilder(self._blocks[0])
        self._row = RowOperations(self._build)
        self._rows: dict[int, Any] = {}

    def generate(self) -> ir.Module:
        program, build = self._program, self._build
        entry, loop, advance, end = self._blocks
        for row in set(range(program.states)) - set(program.signals):
            self._rows[row] = self._row.load(self._arena, LANES * row)
        self._execute(0, program.ends[0])
        count = len(program.slopes)
        starts = [self._row.load(self._arena, LANES * (program.states + i)) for i in range(count)]
        limits = [
            [self._row.load(each, LANES * i) for i in range(count)] if used else []
            for each, used in (
                (self._lower, program.receivers is not None),
                (self._upper, program.receivers is not None),
                (self._caught, program.is_spilling),
            )
        ]
        own_places = self._load_places()
        build.branch(loop)

        build.position_at_end(loop)
        sample = build.phi(_INTEGER, name="sample")
        sample.add_incoming(_INTEGER(0), entry)
        before = [build.phi(each.type) for each in starts]
        for phi, start in zip(before, starts, strict=True):
            phi.add_incoming(start, entry)
        self._read_signals(sample, 0, own_places)
        slopes = self._differentiate(before, program.ends[0])
        self._write_outputs(sample)
        following = build.add(sample, _INTEGER(1))
        build.cbranch(build.icmp_unsigned("<", following, self._samples), advance, end)

        build.position_at_end(advance)
        total = slopes
        half, sixth = self._scale(0.5), self._row.fill(build.fdiv(self._dt, _DOUBLE(6.0)))
        for stage in (1, 2, 3):
            part = half if stage < 3 else self._scale(1.0)
            moved = [build.fadd(x, build.fmul(part, slope)) for x, slope in zip(before, slopes, strict=True)]
            if stage != 2:  # the signals in the middle of the step are known
                self._read_signals(sample, (stage + 1) // 2, own_places)
            slopes = self._differentiate(moved, program.ends[1 if stage == 2 else 0])
            if stage < 3:
                twice = (build.fmul(self._row.constant(2.0), slope) for slope in slopes)
                total = [build.fadd(x, slope) for x, slope in zip(total, twice, strict=True)]
        new = [
            build.fadd(x, build.fmul(sixth, build.fadd(sum_, slope)))
            for x, sum_, slope in zip(before, total, slopes, strict=True)
        ]
        new = self._limit(new, *limits)
        sample.add_incoming(following, build.block)
        for phi, value in zip(before, new, strict=True):
            phi.add_incoming(value, build.block)
        build.branch(loop)

        build.position_at_end(end)
        for index, value in enumerate(before):
            self._row.store(value, self._arena, LANES * (program.states + index))
        build.ret_void()
        return self._module

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

    def _load_places(self) -> list[list[Any]]:
        """Return the place of each own signal in each lane."""
        build, own = self._build, len(self._program.signals) - self._program.shared
        integers = build.bitcast(self._places, _INTEGER.as_pointer())
        return [
            [build.load(build.gep(integers, [_INTEGER(LANES * index + lane)])) for lane in range(LANES)]
            for index in range(own)
        ]

    def _read_signals(self, sample: Any, moment: int, own_places: list[list[Any]]) -> None:
        build, shared = self._build, self._program.shared
        moments = build.add(build.mul(sample, _INTEGER(3)), _INTEGER(moment))
        first = build.mul(moments, _INTEGER(shared))
        for index, row in enumerate(self._program.signals[:shared]):
            place = build.gep(self._shared, [build.add(first, _INTEGER(index))])
            self._rows[row] = self._row.fill(build.load(place))
        first = build.mul(moments, self._own_count)
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
