"""Confinement of the process that reads untrusted files, by Landlock and seccomp of the Linux kernel.

Even if a file makes a library execute code, this code can read nothing but the file and the installed
software, and can neither write, nor change attributes of files, nor use the network, nor start or signal a
process or a thread. Landlock restricts the files, `islands_service.intake.system_calls` everything else.

Source: https://docs.kernel.org/userspace-api/landlock.html.
"""

import ctypes
import mimetypes
import os
import signal
import struct
import sys
import zoneinfo
from collections.abc import Iterable
from pathlib import Path

from islands_service.intake.system_calls import call_kernel, check, explain_unrestricted_calls, restrict_calls
from islands_service.liveness import set_parent_death_signal

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

_libc = ctypes.CDLL(None, use_errno=True)


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
