"""Calls of the functions of an FMU from a kernel: a simulation makes thousands, which Python would dominate.

Functions are called by their machine addresses, so that one kernel serves every FMU. A pointer is the address
of an array. A boolean of FMI 3.0 is one byte, passed like an integer, as the calling conventions of C allow.
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from islands.kernels.jit_cache import kernel

#: Largest status of a call that has succeeded; FMI: OK, warning, discard, error, fatal, pending.
WARNING = 1

#: Status of the kernels for a simulation that the FMU terminates.
TERMINATED = 16

#: Largest number of successive event iterations; an FMU that requires more has no consistent state.
_MAX_EVENT_ITERATIONS = 100


class FmiFunctions(NamedTuple):
    """Machine addresses of the functions of an FMU; zero for those of the other interface.

    Attributes
    ----------
    instance : int
        Address of the instance.
    version : int
        2 or 3, the first number of the version of FMI.
    """

    instance: int
    version: int
    get_values: int
    set_values: int
    do_step: int
    set_time: int
    get_states: int
    set_states: int
    get_derivatives: int
    get_indicators: int
    complete_step: int
    enter_events: int
    update_discrete_states: int
    enter_continuous_time: int


def _make_call(*kinds: types.Type) -> Any:
    """Return a function ``call(address, arguments)`` for kernels, of a C function that returns a status."""

    @intrinsic
    def call(_typingctx, address, arguments):
        def generate(context, builder, signature, values):
            given = signature.args[1].types
            cast = [
                context.cast(builder, builder.extract_value(values[1], place), given[place], kind)
                for place, kind in enumerate(kinds)
            ]
            prototype = ir.FunctionType(ir.IntType(32), [context.get_value_type(kind) for kind in kinds])
            return builder.call(builder.inttoptr(values[0], prototype.as_pointer()), cast)

        return types.int32(types.int64, arguments), generate

    return call


_call_mode = _make_call(types.int64)
_call_time = _make_call(types.int64, types.float64)
_call_states = _make_call(types.int64, types.int64, types.int64)
_call_values2 = _make_call(types.int64, types.int64, types.int64, types.int64)
_call_values3 = _make_call(types.int64, types.int64, types.int64, types.int64, types.int64)
_call_step2 = _make_call(types.int64, types.float64, types.float64, types.int32)
_call_step3 = _make_call(types.int64, types.float64, types.float64, types.int32, *[types.int64] * 4)
_call_completed = _make_call(types.int64, types.int32, types.int64, types.int64)
_call_update2 = _make_call(types.int64, types.int64)
_call_update3 = _make_call(types.int64, *[types.int64] * 6)


@kernel
def enter(address, fmu):
    """Enter a mode; return the status."""
    return _call_mode(address, (fmu.instance,))


@kernel
def set_time(fmu, time):
    """Set the time of a model exchange; return the status."""
    return _call_time(fmu.set_time, (fmu.instance, time))


@kernel
def exchange_states(address, fmu, states):
    """Get or set states, derivatives or event indicators, shape (n,); return the status."""
    if states.size == 0:
        return 0
    return _call_states(address, (fmu.instance, states.ctypes.data, states.size))


@kernel
def exchange_values(address, fmu, references, values):
    """Get or set the variables of the ``references``, uint32; return the status."""
    if references.size == 0:
        return 0
    where, count = references.ctypes.data, references.size
    if fmu.version == 2:
        return _call_values2(address, (fmu.instance, where, count, values.ctypes.data))
    return _call_values3(address, (fmu.instance, where, count, values.ctypes.data, count))


@kernel
def do_step(fmu, time, dt, flags, last):
    """Take a communication step; return the status.

    ``flags`` is uint8 (3,) and ``last`` float64 (1,), which FMI 3.0 writes to.
    """
    if fmu.version == 2:
        return _call_step2(fmu.do_step, (fmu.instance, time, dt, 1))
    flags[:] = 0
    where = flags.ctypes.data
    status = _call_step3(
        fmu.do_step, (fmu.instance, time, dt, 1, where, where + 1, where + 2, last.ctypes.data)
    )
    if status <= WARNING and flags[1] != 0:
        return TERMINATED
    return status


@kernel
def complete_step(fmu, flags):
    """Complete a step of an integrator; return the status and whether the FMU asks for an event."""
    flags[:] = 0
    # Booleans of FMI 2.0 are integers of four bytes, those of FMI 3.0 one byte.
    where = flags.ctypes.data
    status = _call_completed(fmu.complete_step, (fmu.instance, 1, where, where + 4))
    if status <= WARNING and flags[4] != 0:
        return TERMINATED, False
    return status, flags[0] != 0


@kernel
def update_discrete_states(fmu, flags, next_time):
    """Iterate the event equations until they hold; return the status.

    ``next_time`` (1,) becomes the time of the next time event, infinite if there is none.
    """
    for _ in range(_MAX_EVENT_ITERATIONS):
        flags[:] = 0
        next_time[0] = 0.0
        where = flags.ctypes.data
        if fmu.version == 2:
            status = _call_update2(fmu.update_discrete_states, (fmu.instance, where))
            is_needed, is_ended, has_time = flags[0] != 0, flags[4] != 0, flags[16] != 0
            next_time[0] = flags[24:32].view(np.float64)[0]
        else:
            status = _call_update3(
                fmu.update_discrete_states,
                (fmu.instance, where, where + 1, where + 2, where + 3, where + 4, next_time.ctypes.data),
            )
            is_needed, is_ended, has_time = flags[0] != 0, flags[1] != 0, flags[4] != 0
        if not has_time:
            next_time[0] = float("inf")
        if status > WARNING:
            return status
        if is_ended:
            return TERMINATED
        if not is_needed:
            return status
    return TERMINATED
