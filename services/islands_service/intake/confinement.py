"""Confinement of the process that reads untrusted files, by Landlock and seccomp of the Linux kernel.

Even if a file makes a library execute code, this code can read nothing but the file and the installed
software, and can neither write, nor use the network, nor start or signal a process.

Sources: https://docs.kernel.org/userspace-api/landlock.html,
https://docs.kernel.org/userspace-api/seccomp_filter.html.
"""

import ctypes
import mimetypes
import os
import platform
import struct
import sys
import zoneinfo
from collections.abc import Iterable
from errno import EINVAL, ENOSYS, EPERM
from pathlib import Path

_PR_SET_NO_NEW_PRIVS, _PR_SET_SECCOMP, _SECCOMP_MODE_FILTER = 38, 22, 2

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

#: Identifiers of architectures for seccomp, and the column of their numbers in `_FORBIDDEN`.
_ARCHITECTURES = {"x86_64": (0xC000003E, 0), "aarch64": (0xC00000B7, 1)}

#: System calls that are refused, with their numbers on x86_64 and aarch64; None where there is no such call.
_FORBIDDEN = {
    "socket": (41, 198),
    "socketpair": (53, 199),
    "bind": (49, 200),
    "connect": (42, 203),
    "sendto": (44, 206),
    "sendmsg": (46, 211),
    "sendmmsg": (307, 269),
    "fork": (57, None),
    "vfork": (58, None),
    "execve": (59, 221),
    "execveat": (322, 281),
    "kill": (62, 129),
    "tkill": (200, 130),
    "tgkill": (234, 131),
    "rt_sigqueueinfo": (129, 138),
    "rt_tgsigqueueinfo": (297, 240),
    "pidfd_send_signal": (424, 424),
    "pidfd_open": (434, 434),
    "pidfd_getfd": (438, 438),
    "ptrace": (101, 117),
    "process_vm_readv": (310, 270),
    "process_vm_writev": (311, 271),
    "setpriority": (141, 140),
    "mount": (165, 40),
    "umount2": (166, 39),
    "unshare": (272, 97),
    "setns": (308, 268),
    "add_key": (248, 217),
    "request_key": (249, 218),
    "keyctl": (250, 219),
    "bpf": (321, 280),
    "perf_event_open": (298, 241),
    "userfaultfd": (323, 282),
    "io_uring_setup": (425, 425),
}

#: Numbers of calls whose arguments decide: a thread may be started, and the own limits may be read.
_CLONE, _PRLIMIT, _CLONE3 = (56, 220), (302, 261), (435, 435)
_CLONE_THREAD = 0x10000

# Instructions of the filter: load a word, compare it, return; see linux/bpf_common.h.
_LOAD, _EQUAL, _HAS_BITS, _RETURN = 0x20, 0x15, 0x45, 0x06
_ALLOW, _REFUSE = 0x7FFF0000, 0x00050000

#: Offsets of the number, the architecture and the lower half of the first argument of a system call.
_NUMBER, _ARCHITECTURE, _FIRST_ARGUMENT = 0, 4, 16

_libc = ctypes.CDLL(None, use_errno=True)


def confine(readable: Iterable[Path], writable: Iterable[Path] = ()) -> bool:
    """Restrict this process for the rest of its life, as far as the kernel supports it.

    Parameters
    ----------
    readable : iterable of Path
        Files and folders that can be read, in addition to the installed software.
    writable : iterable of Path
        Folders in which files can be made and read.

    Returns
    -------
    bool
        Whether the kernel restricts the files.

    Raises
    ------
    OSError
        The kernel supports a restriction but refuses it.
    """
    if sys.platform != "linux":
        return False
    _check(_libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0))
    is_restricted = _restrict_files((*readable, *_list_software()), writable)
    _restrict_calls()
    return is_restricted


def _list_software() -> set[Path]:
    # The modules of this project may be found by an import hook instead of a folder of `sys.path`.
    import islands  # noqa: PLC0415

    own = (Path(islands.__file__).parents[1], Path(__file__).parents[2])
    folders = (sys.prefix, sys.base_prefix, *filter(None, sys.path), *own, *_SYSTEM)
    return {path for path in map(Path, folders) if path.exists()}


def _restrict_files(readable: Iterable[Path], writable: Iterable[Path]) -> bool:
    version = _libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), 1)
    if version < 1:  # not supported, or forbidden by the filter of an old container engine
        return False
    rights = _RIGHTS[min(version, len(_RIGHTS)) - 1]
    attributes = (rights, 3 * (version >= _WITH_NETWORK), 3 * (version >= _WITH_SCOPES))
    known = attributes[: 1 + (version >= _WITH_NETWORK) + (version >= _WITH_SCOPES)]
    packed = struct.pack(f"{len(known)}Q", *known)
    ruleset = _check(_libc.syscall(_CREATE_RULESET, packed, ctypes.c_size_t(len(packed)), 0))
    read = _EXECUTE | _READ_FILE
    granted = [(path, read | (_READ_DIR if path.is_dir() else 0)) for path in readable]
    for path, allowed in (*granted, *((path, rights) for path in writable)):
        descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC)
        rule = struct.pack("=Qi", allowed, descriptor)
        _check(_libc.syscall(_ADD_RULE, ruleset, 1, rule, 0))
        os.close(descriptor)
    _check(_libc.syscall(_RESTRICT_SELF, ruleset, 0))
    os.close(ruleset)
    return True


def _restrict_calls() -> None:
    architecture, column = _ARCHITECTURES.get(platform.machine(), (0, 0))
    if not architecture:
        return
    refuse = [(_RETURN, 0, 0, _REFUSE | EPERM)]
    allow = [(_RETURN, 0, 0, _ALLOW)]
    program = [
        (_LOAD, 0, 0, _ARCHITECTURE),
        (_EQUAL, 1, 0, architecture),
        *refuse,
        (_LOAD, 0, 0, _NUMBER),
        # Calls of the x32 interface of x86_64 have other numbers.
        *([(_HAS_BITS, 0, 1, 0x40000000), *refuse] if column == 0 else []),
    ]
    for numbers in _FORBIDDEN.values():
        if (number := numbers[column]) is not None:
            program += [(_EQUAL, 0, 1, number), *refuse]
    program += [
        # The arguments of clone3 cannot be examined; without it the C library uses clone.
        *[(_EQUAL, 0, 1, _CLONE3[column]), (_RETURN, 0, 0, _REFUSE | ENOSYS)],
        *[(_EQUAL, 0, 4, _CLONE[column]), (_LOAD, 0, 0, _FIRST_ARGUMENT)],
        *[(_HAS_BITS, 0, 1, _CLONE_THREAD), *allow, *refuse],
        *[(_EQUAL, 0, 3, _PRLIMIT[column]), (_LOAD, 0, 0, _FIRST_ARGUMENT), (_EQUAL, 1, 0, 0), *refuse],
        *allow,
    ]
    code = b"".join(struct.pack("HBBI", *instruction) for instruction in program)
    buffer = ctypes.create_string_buffer(code)
    filtered = struct.pack("HxxxxxxP", len(program), ctypes.addressof(buffer))
    if _libc.prctl(_PR_SET_SECCOMP, _SECCOMP_MODE_FILTER, filtered) and ctypes.get_errno() != EINVAL:
        _check(-1)


def _check(result: int) -> int:
    if result < 0:
        number = ctypes.get_errno()
        raise OSError(number, f"this process cannot be confined: {os.strerror(number)}")
    return result
