"""Allow list of system calls of a confined process, enforced by seccomp of the Linux kernel.

A process that reads a file needs the calls of `_CALLS`. Every other call is refused, also those of kernels to
come, so that nothing has to be listed that could do harm: a confined process has one thread, starts none,
shares no memory, sends no signal, and changes no attribute of a file. An allowed call acts on this process
alone, or on what Landlock lets it read; arguments that could do more are refused, see `_CONDITIONS`.

Source: https://docs.kernel.org/userspace-api/seccomp_filter.html.
"""

import ctypes
import fcntl
import os
import platform
import struct
from dataclasses import dataclass
from errno import ENOSYS, EPERM

#: Identifiers of architectures for seccomp, and the column of their numbers in `_CALLS`.
_ARCHITECTURES = {"x86_64": (0xC000003E, 0), "aarch64": (0xC00000B7, 1)}

#: System calls that are allowed, with their numbers on x86_64 and aarch64; None where there is no such call.
_CALLS: dict[str, tuple[int | None, int | None]] = {
    # Memory
    "brk": (12, 214),
    "mmap": (9, 222),
    "munmap": (11, 215),
    "mprotect": (10, 226),
    "mremap": (25, 216),
    "madvise": (28, 233),
    "msync": (26, 227),
    "mincore": (27, 232),
    # Files
    "open": (2, None),
    "openat": (257, 56),
    "close": (3, 57),
    "close_range": (436, 436),
    "read": (0, 63),
    "readv": (19, 65),
    "pread64": (17, 67),
    "preadv": (295, 69),
    "write": (1, 64),
    "writev": (20, 66),
    "lseek": (8, 62),
    "stat": (4, None),
    "lstat": (6, None),
    "fstat": (5, 80),
    "newfstatat": (262, 79),
    "statx": (332, 291),
    "statfs": (137, 43),
    "fstatfs": (138, 44),
    "access": (21, None),
    "faccessat": (269, 48),
    "faccessat2": (439, 439),
    "readlink": (89, None),
    "readlinkat": (267, 78),
    "getcwd": (79, 17),
    "chdir": (80, 49),
    "fchdir": (81, 50),
    "getdents64": (217, 61),
    "fadvise64": (221, 223),
    "fcntl": (72, 25),
    "dup": (32, 23),
    "dup2": (33, None),
    "dup3": (292, 24),
    "pipe2": (293, 59),
    "poll": (7, None),
    "ppoll": (271, 73),
    "select": (23, None),
    "pselect6": (270, 72),
    # Time
    "clock_gettime": (228, 113),
    "clock_getres": (229, 114),
    "clock_nanosleep": (230, 115),
    "nanosleep": (35, 101),
    "gettimeofday": (96, 169),
    "time": (201, None),
    "times": (100, 153),
    "getrusage": (98, 165),
    # This process
    "rt_sigaction": (13, 134),
    "rt_sigprocmask": (14, 135),
    "rt_sigreturn": (15, 139),
    "sigaltstack": (131, 132),
    "restart_syscall": (219, 128),
    "futex": (202, 98),
    "rseq": (334, 293),
    "sched_yield": (24, 124),
    "sched_getaffinity": (204, 123),
    "getcpu": (309, 168),
    "getpid": (39, 172),
    "getppid": (110, 173),
    "gettid": (186, 178),
    "getuid": (102, 174),
    "geteuid": (107, 175),
    "getgid": (104, 176),
    "getegid": (108, 177),
    "getrandom": (318, 278),
    "getrlimit": (97, 163),
    "prlimit64": (302, 261),
    "uname": (63, 160),
    "sysinfo": (99, 179),
    "exit": (60, 93),
    "exit_group": (231, 94),
}

#: Further calls of a process that makes files in a folder, and restricts itself further after that.
_PREPARATION: dict[str, tuple[int | None, int | None]] = {
    "mkdir": (83, None),
    "mkdirat": (258, 34),
    "prctl": (157, 167),
    "seccomp": (317, 277),
    "landlock_create_ruleset": (444, 444),
    "landlock_add_rule": (445, 445),
    "landlock_restrict_self": (446, 446),
}

#: Bits of the flags of an opened file that change it, or make one.
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC


@dataclass(frozen=True, slots=True)
class _Condition:
    """Condition on the lower half of an argument, which is all that these calls read.

    Attributes
    ----------
    argument : int
        Place of the argument, from 0.
    values : tuple of int
        Values that are allowed; empty if all are.
    refused_bits : int
    """

    argument: int
    values: tuple[int, ...] = ()
    refused_bits: int = 0


#: Conditions on calls that could otherwise act on something else than this process.
_CONDITIONS = {
    # Landlock restricts the opening of a file that truncates it from Linux 6.2 on only.
    "open": _Condition(1, refused_bits=_WRITES),
    "openat": _Condition(2, refused_bits=_WRITES),
    # Not the commands that send signals to the owner of a file, or lock files.
    "fcntl": _Condition(
        1, values=(fcntl.F_DUPFD, fcntl.F_GETFD, fcntl.F_SETFD, fcntl.F_GETFL, fcntl.F_DUPFD_CLOEXEC)
    ),
    # Not the limits of another process.
    "prlimit64": _Condition(0, values=(0,)),
}

# Instructions of the filter: load a word, compare it, return; see linux/bpf_common.h.
_LOAD, _EQUAL, _AT_LEAST, _HAS_BITS, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_ALLOW, _REFUSE = (_RETURN, 0, 0, 0x7FFF0000), (_RETURN, 0, 0, 0x00050000 | EPERM)

#: The answer to calls that are newer than the list: the C library then makes an older one.
_UNKNOWN, _FIRST_UNKNOWN = (_RETURN, 0, 0, 0x00050000 | ENOSYS), 447

#: Offsets of the number, the architecture and the first argument of a system call; an argument has 8 bytes.
_NUMBER, _ARCHITECTURE, _ARGUMENTS = 0, 4, 16

#: Operations of seccomp: install a filter, and ask whether the kernel knows an action.
_SET_FILTER, _GET_ACTION = 1, 2

_libc = ctypes.CDLL(None, use_errno=True)


def call_kernel(number: int, *arguments: object) -> int:
    """Make a system call; return its result.

    Raises
    ------
    OSError
    """
    return check(_libc.syscall(number, *arguments))


def check(result: int) -> int:
    """Return the result of a function of the C library.

    Raises
    ------
    OSError
        It is negative.
    """
    if result < 0:
        error = ctypes.get_errno()
        raise OSError(error, f"this process cannot be confined: {os.strerror(error)}")
    return result


def explain_unrestricted_calls() -> str:
    """Return what the restriction of system calls lacks on this machine; empty if it is possible."""
    machine = platform.machine()
    if machine not in _ARCHITECTURES:
        return f"a list of the system calls of {machine} (there is one for {' and '.join(_ARCHITECTURES)})"
    try:
        action = ctypes.c_uint32(_REFUSE[-1] & ~EPERM)
        call_kernel(_get_seccomp(), _GET_ACTION, 0, ctypes.byref(action))
    except OSError:
        return "seccomp filters (CONFIG_SECCOMP_FILTER)"
    return ""


def restrict_calls(prepares: bool = False) -> None:
    """Refuse all system calls that are not in the list, for the rest of the life of this process.

    Parameters
    ----------
    prepares : bool
        Whether the process makes files, and restricts itself further after that.

    Raises
    ------
    OSError
    """
    code = b"".join(struct.pack("HBBI", *instruction) for instruction in _make_filter(prepares))
    buffer = ctypes.create_string_buffer(code)
    program = struct.pack("HxxxxxxP", len(code) // 8, ctypes.addressof(buffer))
    call_kernel(_get_seccomp(), _SET_FILTER, 0, program)


def _get_seccomp() -> int:
    number = _PREPARATION["seccomp"][_ARCHITECTURES[platform.machine()][1]]
    assert number is not None, "every architecture has seccomp"
    return number


def _make_filter(prepares: bool) -> list[tuple[int, int, int, int]]:
    """Return the instructions of the filter: operation, jump if true, jump if false, operand."""
    architecture, column = _ARCHITECTURES[platform.machine()]
    program = [(_LOAD, 0, 0, _ARCHITECTURE), (_EQUAL, 1, 0, architecture), _REFUSE, (_LOAD, 0, 0, _NUMBER)]
    calls, conditions = _CALLS, _CONDITIONS
    if prepares:
        calls = {**_CALLS, **_PREPARATION}
        conditions = {name: each for name, each in _CONDITIONS.items() if not each.refused_bits}
    for name, numbers in calls.items():
        if (number := numbers[column]) is not None:
            allowed = _allow_arguments(conditions[name]) if name in conditions else [_ALLOW]
            program += [(_EQUAL, 0, len(allowed), number), *allowed]
    # Numbers of the x32 interface of x86_64 are larger, too.
    return [*program, (_AT_LEAST, 0, 1, _FIRST_UNKNOWN), _UNKNOWN, _REFUSE]


def _allow_arguments(condition: _Condition) -> list[tuple[int, int, int, int]]:
    load = (_LOAD, 0, 0, _ARGUMENTS + 8 * condition.argument)
    if condition.refused_bits:
        return [load, (_HAS_BITS, 0, 1, condition.refused_bits), _REFUSE, _ALLOW]
    return [load, *(each for value in condition.values for each in ((_EQUAL, 0, 1, value), _ALLOW)), _REFUSE]
