"""Machine code of a program: what the kernel interprets, with states and intermediate results in registers.

An interpreted instruction waits for the result of the one before in memory. Machine code needs a quarter of
the time, but a compilation takes 50 ms, so that programs are compiled if they run often, and stored. Machine
code executes the same operations in the same order without contraction: every bit is that of the interpreter.
Programs that call force laws, or functions of the C library other than the exponential, remain interpreted.
"""

import ctypes
from collections import OrderedDict
from contextlib import suppress
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from tempfile import NamedTemporaryFile
from threading import Lock
from typing import Any

import numpy as np
from llvmlite import binding
from numpy.typing import NDArray

from islands.kernels.jit_cache import cache_folder
from islands.simulators.ode import kernel as ode_kernel
from islands.simulators.ode.kernel_arguments import LANES, LaneLimits, LaneRestarts, LaneSignals
from islands.simulators.ode.lane_values import LaneArguments
from islands.simulators.ode.native_generator import FUNCTION, NativeGenerator, ProgramCode
from islands.simulators.ode.program import OdeProgram

#: Largest number of stored programs, about 20 kB each. If there are more, the older half is deleted.
MAX_STORED = 2000

_DIGEST = sha256().digest_size

#: Interpreted instructions, once per step, after which a program is compiled: they take as long as the
#: compilation.
COMPILED_FROM = 1_500_000

#: Factor of this number for code of `MANY_LANES`, which replaces machine code and saves less.
MANY_LANES_FACTOR = 20

#: Largest number of instructions of a compiled program; the time of a compilation grows with it.
MAX_INSTRUCTIONS = 300

#: Number of programs whose instructions are counted, and of those with machine code, about 1 MB each.
_COUNTED, _KEPT = 256, 64

_counts: OrderedDict[ProgramCode, float] = OrderedDict()
_lock = Lock()


def is_stored(program: ProgramCode) -> bool:
    """Return whether there is machine code of a program."""
    file = _find_file(program)
    return file is not None and file.exists()


def load_code(program: ProgramCode) -> bytes | None:
    """Load the machine code of a program, an object file; None if there is none, or if it is damaged."""
    file = _find_file(program)
    with suppress(OSError):
        content = file.read_bytes() if file is not None else b""
        if content and sha256(content[_DIGEST:]).digest() == content[:_DIGEST]:
            return content[_DIGEST:]
    return None


def store_code(program: ProgramCode, code: bytes) -> None:
    """Store the machine code of a program, if the folder can be written."""
    file = _find_file(program)
    if file is None:
        return
    with suppress(OSError):  # read-only folder, full disk: the next process compiles again
        file.parent.mkdir(exist_ok=True)
        with NamedTemporaryFile(dir=file.parent, delete=False) as draft:
            draft.write(sha256(code).digest() + code)
        Path(draft.name).replace(file)
        _delete_oldest(file.parent)


def _find_file(program: ProgramCode) -> Path | None:
    # The name of the cache folder depends on the processor and on the sources of the generator.
    folder = cache_folder()
    return None if folder is None else folder / "programs" / sha256(repr(program).encode()).hexdigest()


def _delete_oldest(folder: Path) -> None:
    files = list(folder.iterdir())
    if len(files) > MAX_STORED:
        for file in sorted(files, key=lambda each: each.stat().st_mtime)[: len(files) // 2]:
            file.unlink(missing_ok=True)


class NativeCode:
    """Machine code of a program.

    Parameters
    ----------
    program : ProgramCode
    code : bytes
        The object file of `generate_code`.
    """

    def __init__(self, program: ProgramCode, code: bytes) -> None:
        self._lanes = program.lanes
        self._states = slice(program.states, program.states + len(program.slopes))
        self._engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _make_machine())
        self._engine.add_object_file(binding.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        integers, pointers = [ctypes.c_int64] * 5, [ctypes.c_void_p] * 9
        signature = ctypes.CFUNCTYPE(None, *integers, ctypes.c_double, *pointers)
        self._function = signature(self._engine.get_function_address(FUNCTION))

    def integrate(
        self,
        given: LaneArguments,
        signals: LaneSignals,
        dt: float,
        restarts: LaneRestarts,
        lanes: int,
        first: int,
        every: int,
        out: NDArray[np.float64],
    ) -> None:
        """Integrate as `ode_kernel.integrate`, without force laws; restarts are at regular intervals."""
        arena, limits = given.arena, given.limits
        arrays = (
            *(arena, signals.shared, signals.own, signals.places),
            *(limits.lower, limits.upper, limits.caught, restarts.states, out[:, :, first:]),
        )
        samples = signals.shared.shape[0]
        interval = int(restarts.samples[1]) if restarts.samples.size > 1 else samples
        sizes = samples, every, interval, signals.own.shape[2], out.shape[2]
        self._function(*sizes, dt, *(each.ctypes.data for each in arrays))
        if not restarts.samples.size:
            is_finite = np.isfinite(arena.reshape(-1, self._lanes)[self._states, :lanes]).all(axis=0)
            out[:, :, first : first + lanes][:, :, ~is_finite] = np.nan


def find_native_code(
    program: OdeProgram,
    signals: LaneSignals,
    order: NDArray[np.int64],
    limits: LaneLimits,
    restarts: LaneRestarts,
) -> NativeCode | None:
    """Return the machine code of a program that runs often or is stored; count the instructions of others."""
    lanes = signals.places.shape[2]
    code = _describe(
        program,
        order.tobytes(),
        signals.shared.shape[2],
        tuple(limits.receivers.tolist()) if limits.lower.size else None,
        limits.caught.size > 0,
        restarts.states.shape[1] // lanes,
        signals.places.shape[0] > 1,
        lanes,
    )
    if code is None:
        return None
    with _lock:
        executed = _counts.pop(code, None)
        if executed is None:
            executed = np.inf if is_stored(code) else 0
        _counts[code] = executed + signals.shared.shape[0] * len(program.instructions.code)
        while len(_counts) > _COUNTED:
            _counts.popitem(last=False)
        least = COMPILED_FROM * (1 if lanes == LANES else MANY_LANES_FACTOR)
        return _compile(code) if executed >= least else None


@lru_cache(maxsize=_COUNTED)
def _describe(
    program: OdeProgram,
    order: bytes,
    shared: int,
    receivers: tuple[int, ...] | None,
    is_spilling: bool,
    restarted: int,
    is_moving: bool,
    lanes: int,
) -> ProgramCode | None:
    """Return what the machine code of a program depends on; None if it remains interpreted.

    A program remains interpreted if it is long, or calls force laws or functions that machine code cannot.
    """
    instructions = program.instructions
    operations = instructions.code[:, 0]
    calls = operations[operations >= ode_kernel.POWER]
    if operations.size > MAX_INSTRUCTIONS or not (calls == ode_kernel.EXPONENTIAL).all():
        return None
    return ProgramCode(
        code=instructions.code.tobytes(),
        ends=tuple(instructions.ends.tolist()),
        signals=tuple(instructions.signals[np.frombuffer(order, dtype=np.int64)].tolist()),
        slopes=tuple(instructions.slopes.tolist()),
        outputs=tuple(instructions.outputs.tolist()),
        states=instructions.states,
        shared=shared,
        receivers=receivers,
        is_spilling=is_spilling,
        restarted=restarted,
        is_moving=is_moving,
        lanes=lanes,
    )


@lru_cache(maxsize=_KEPT)
def _compile(program: ProgramCode) -> NativeCode:
    code = load_code(program)
    if code is None:
        code = generate_code(program)
        store_code(program, code)
    return NativeCode(program, code)


def generate_code(program: ProgramCode) -> bytes:
    """Generate the machine code of a program for this processor, as an object file."""
    machine = _make_machine()
    module = binding.parse_assembly(str(NativeGenerator(program).generate()))
    options = binding.create_pipeline_tuning_options(speed_level=1)
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    code: bytes = machine.emit_object(module)
    return code


def _make_machine() -> Any:
    """Return a new description of this processor: each execution engine takes ownership of one."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=2
    )
