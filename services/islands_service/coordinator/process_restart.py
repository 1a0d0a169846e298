"""Restart of the coordinator in its own process, which ends a computation that cannot be interrupted."""

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from islands_service.liveness import STARTING, send_heartbeat

#: Standard input, output and error.
_STANDARD = (0, 1, 2)


def restart_process(lifeline: int | None, *kept: int | None) -> NoReturn:
    """Start the program of this process again in its place, with the same arguments and environment.

    All threads end at once, whatever they compute, and child processes are killed. Ray notices that the
    connections of this driver are closed, and ends its tasks and actors. For the supervisor it is the same
    process.

    Parameters
    ----------
    lifeline : int or None
        Heartbeat pipe of the supervisor, which stays open.
    *kept : int or None
        Further file descriptors that stay open.
    """
    for child in _find_children():
        with suppress(ProcessLookupError, ChildProcessError):
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
    for descriptor in [int(each.name) for each in Path("/proc/self/fd").iterdir()]:
        # Without this, Ray's connections would stay open.
        if descriptor not in (*_STANDARD, lifeline, *kept):
            with suppress(OSError):
                os.set_inheritable(descriptor, False)
    send_heartbeat(lifeline, STARTING)
    os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])


def _find_children() -> list[int]:
    found: list[int] = []
    for task in Path("/proc/self/task").iterdir():
        with suppress(OSError):
            found += map(int, (task / "children").read_text().split())
    return found
