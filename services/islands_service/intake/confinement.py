"""Confinement of the process that reads untrusted files, by Landlock and seccomp of the Linux kernel.

Even if a file makes a library execute code, this code can read nothing but the file and the installed
software, and can neither write, nor change attributes of files, nor use the network, nor start or signal a
process or a thread. Landlock restricts the files, `islands_service.intake.confinement` everything else.

Source: https://docs.kernel.org/userspace-api/landlock.html.
"""

import ctypes
import fcntl
import mimetypes
import os
import platform
import signal
import struct
import sys
import zoneinfo
from collections.abc import Iterable
from dataclasses import dataclass
from errno import ENOSYS, EPERM
from pathlib import Path

from islands_service.liveness import set_parent_death_signal

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

#: Numbers of Landlock's system calls on all architectures.
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446

#: Rights of files that each version of Landlock knows, from version 1 on; see linux/landlock.h.
_RIGHTS = (1 << 13) - 1, (1 << 14) - 1, (1 << 15) - 1, (1 << 15) - 1, (1 << 16) - 1

#: Rights to execute and read files, and to list folders.
_EXECUTE, _READ_FILE, _READ_DIR = 1, 4, 8

#: Version of Landlock from which on it restricts TCP, and signals and abstract sockets.
_WITH_NETWORK, _WITH_SCOPES = 4, 6

#: Folders and files of the system that libraries read.
_SYSTEM = (
    *("/lib", "/lib64", "/usr/lib", "/usr/lib64", "/usr/local/lib", "/nix/store", "/gnu/store"),
    *("/etc/ld.so.cache", "/etc/localtime", "/proc/self", "/proc/cpuinfo", "/proc/meminfo"),
    *("/sys/devices/system/cpu", "/dev/null", "/dev/urandom"),
    *zoneinfo.TZPATH,
    *mimetypes.knownfiles,
)

#: User and group of a confined process of a service that is root: no file belongs to them by convention.
_UNPRIVILEGED = 65534

#: Capabilities to read files of other users. The process keeps one, since its file may belong to root.
_CAP_DAC_OVERRIDE, _CAP_DAC_READ_SEARCH = 1 << 1, 1 << 2

#: Version of the structures of capabilities: header, and two halves of effective, permitted and inheritable.
_CAPABILITIES_VERSION = 0x20080522
_HEADER, _CAPABILITIES = struct.Struct("Ii"), struct.Struct("6I")

#: Options of prctl.
_PR_SET_KEEPCAPS, _PR_SET_NO_NEW_PRIVS = 8, 38


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


def find_gaps() -> tuple[str, ...]:
    """Return what this machine lacks to confine native code."""
    if sys.platform != "linux":
        return ("Linux",)
    landlock = "" if _find_landlock() else "Landlock (Linux 5.13 or later)"
    return tuple(filter(None, (landlock, explain_unrestricted_calls())))


def confine(readable: Iterable[Path], writable: Iterable[Path] = ()) -> tuple[str, ...]:
    """Restrict this process for the rest of its life, as far as the kernel supports it.

    Parameters
    ----------
    readable : iterable of Path
        Files and folders that can be read, in addition to the installed software.
    writable : iterable of Path
        Folders in which files can be made and read, until this function is called again without any.

    Returns
    -------
    tuple of str
        What this machine lacks for it.

    Raises
    ------
    OSError
        The kernel supports a restriction but refuses it.
    """
    gaps, folders = find_gaps(), tuple(writable)
    if sys.platform == "linux":
        check(_libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0))
        if not os.geteuid():
            gaps += _drop_root(folders)
        if version := _find_landlock():
            _restrict_files(version, (*readable, *_list_software()), folders)
        if not explain_unrestricted_calls():
            restrict_calls(prepares=bool(folders))
    return gaps


def _drop_root(writable: Iterable[Path]) -> tuple[str, ...]:
    """Become a user without any right but to read; return what this process lacks for it."""
    header = _HEADER.pack(_CAPABILITIES_VERSION, 0)
    found = ctypes.create_string_buffer(_CAPABILITIES.size)
    check(_libc.capget(header, found))
    permitted = _CAPABILITIES.unpack(found)[1]
    kept = permitted & _CAP_DAC_READ_SEARCH or permitted & _CAP_DAC_OVERRIDE
    try:
        for folder in writable:
            os.chown(folder, _UNPRIVILEGED, _UNPRIVILEGED)
        check(_libc.prctl(_PR_SET_KEEPCAPS, 1, 0, 0, 0))
        os.setgroups([])
        os.setresgid(_UNPRIVILEGED, _UNPRIVILEGED, _UNPRIVILEGED)
        if kept:
            os.setresuid(_UNPRIVILEGED, _UNPRIVILEGED, _UNPRIVILEGED)
    except OSError:  # a container whose root has few rights, or in which there is no other user
        kept = 0
    check(_libc.capset(header, _CAPABILITIES.pack(kept, kept, 0, 0, 0, 0)))
    # A change of the user resets it.
    set_parent_death_signal(signal.SIGKILL)
    return () if kept else ("the right of its root to become another user (CAP_SETUID, CAP_SETGID)",)


def _list_software() -> set[Path]:
    # The modules of this project may be found by an import hook instead of a folder of `sys.path`.
    import islands  # noqa: PLC0415

    own = (Path(islands.__file__).parents[1], Path(__file__).parents[2])
    folders = (sys.prefix, sys.base_prefix, *filter(None, sys.path), *own, *_SYSTEM)
    return {path for path in map(Path, folders) if path.exists()}


def _find_landlock() -> int:
    """Return the version of Landlock; 0 if the kernel, or the filter of an old container engine, has none."""
    try:
        return call_kernel(_CREATE_RULESET, None, ctypes.c_size_t(0), 1)
    except OSError:
        return 0


def _restrict_files(version: int, readable: Iterable[Path], writable: Iterable[Path]) -> None:
    rights = _RIGHTS[min(version, len(_RIGHTS)) - 1]
    attributes = (rights, 3 * (version >= _WITH_NETWORK), 3 * (version >= _WITH_SCOPES))
    known = attributes[: 1 + (version >= _WITH_NETWORK) + (version >= _WITH_SCOPES)]
    packed = struct.pack(f"{len(known)}Q", *known)
    ruleset = call_kernel(_CREATE_RULESET, packed, ctypes.c_size_t(len(packed)), 0)
    read = _EXECUTE | _READ_FILE
    granted = [(path, read | (_READ_DIR if path.is_dir() else 0)) for path in readable]
    for path, allowed in (*granted, *((path, rights) for path in writable)):
        descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC)
        rule = struct.pack("=Qi", allowed, descriptor)
        call_kernel(_ADD_RULE, ruleset, 1, rule, 0)
        os.close(descriptor)
    call_kernel(_RESTRICT_SELF, ruleset, 0)
    os.close(ruleset)
