"""A command in a process that is ended at a limit or by a stop request, with the CPU time that it took."""

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from signal import SIGKILL, SIGXCPU
from subprocess import DEVNULL, STDOUT, Popen
from time import monotonic, sleep

#: Seconds between two checks.
_CHECK_SECONDS = 0.1


@dataclass(frozen=True, slots=True)
class EndedCommand:
    """How a command has ended.

    Attributes
    ----------
    code : int
        Exit code; the negative number of the signal that has ended it.
    is_stopped : bool
        Whether it was ended by the check, and not by itself.
    cpu_s : float
        CPU seconds, user and system, of the process and of those that it has waited for.
    wall_s : float
    """

    code: int
    is_stopped: bool
    cpu_s: float
    wall_s: float

    @property
    def exceeds_cpu(self) -> bool:
        """Whether the process has reached its own limit of CPU seconds (``RLIMIT_CPU``)."""
        return self.code == -SIGXCPU


def run_command(
    command: Sequence[str | Path], log: Path, must_end: Callable[[float], bool] = lambda _wall_s: False
) -> EndedCommand:
    """Run a command, and write its output to a file.

    Ctrl-C in a terminal does not reach it, and processes that it starts end with it.

    Parameters
    ----------
    command : sequence of str or Path
    log : Path
        File for the standard output and the standard error.
    must_end : callable
        Called at the start, and many times a second, with the seconds since the start. The command is ended
        once it returns true, or raises.
    """
    began = monotonic()
    with log.open("wb") as file:
        process = Popen(command, stdin=DEVNULL, stdout=file, stderr=STDOUT, start_new_session=True)
    is_stopped, found = False, 0
    try:
        while not found:
            # `os.wait4` returns what `Popen.wait` does not: the CPU time.
            if must_end(monotonic() - began):
                is_stopped = True
                os.killpg(process.pid, SIGKILL)
                found, status, usage = os.wait4(process.pid, 0)
            else:
                sleep(_CHECK_SECONDS)
                found, status, usage = os.wait4(process.pid, os.WNOHANG)
    finally:
        # The group is absent once the command and all processes that it has started have ended.
        with suppress(ProcessLookupError):
            os.killpg(process.pid, SIGKILL)
        if not found:
            process.wait()
    process.returncode = os.waitstatus_to_exitcode(status)
    return EndedCommand(process.returncode, is_stopped, usage.ru_utime + usage.ru_stime, monotonic() - began)
