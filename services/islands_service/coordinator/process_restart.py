"""Restart of the coordinator in its own process, which ends a computation that cannot be interrupted."""

import os
import signal
import sys
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

#: Standard input, output and error.
_STANDARD = (0, 1, 2)


def restart_process(kept: Collection[int | None]) -> NoReturn:
    """Start the program of this process again in its place, with the same arguments and environment.

    All threads end at once, whatever they compute, and child processes are killed. Ray notices that the
    connections of this driver are closed, and ends its tasks and actors. For the supervisor it is the same
    process.

    Parameters
    ----------
    kept : collection of int or None
        File descriptors that stay open: those that the supervisor has passed.
    """
    for child in _find_children():
        with suppress(ProcessLookupError, ChildProcessError):
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
    for descriptor in [int(each.name) for each in Path("/proc/self/fd").iterdir()]:
        # Without this, Ray's connections would stay open.
        if descriptor not in (*_STANDARD, *kept):
            with suppress(OSError):
                os.set_inheritable(descriptor, False)
    os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])


def _find_children() -> list[int]:
    found: list[int] = []
    for task in Path("/proc/self/task").iterdir():
        with suppress(OSError):
            found += map(int, (task / "children").read_text().split())
    return found
