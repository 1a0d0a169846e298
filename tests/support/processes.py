"""Processes and their descendants, read from /proc."""

import os
import signal
import time
from collections.abc import Callable, Iterable
from pathlib import Path


def descendants(pid: int) -> dict[int, str]:
    """Return the descendants of a process with their command lines."""
    parents, lines = {}, {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            try:
                state = (folder / "stat").read_text()
                lines[int(folder.name)] = (folder / "cmdline").read_text().replace("\0", " ")
            except OSError:  # the process has ended
                continue
            parents[int(folder.name)] = int(state.rpartition(")")[2].split()[1])
    found, latest = {}, {pid}
    while latest:
        latest = {child for child, parent in parents.items() if parent in latest} - found.keys()
        found |= {child: lines[child] for child in latest}
    return found


def actors(pid: int | None = None) -> list[int]:
    """Return the island actors that a process has started; the default is this process."""
    return [child for child, line in descendants(pid or os.getpid()).items() if "IslandActor" in line]


def alive(pids: Iterable[int]) -> list[int]:
    """Return the processes that have not ended; zombies have ended."""
    return [pid for pid in pids if _state(pid) not in ("", "Z")]


def _state(pid: int) -> str:
    """Return the state letter of a process; empty if there is no such process."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:  # the process may end during the call
        return ""


def kill(pid: int) -> None:
    os.kill(pid, signal.SIGKILL)


def eventually(condition: Callable[[], object], seconds: float = 60.0) -> object:
    """Wait until a condition is true and return its value."""
    deadline, pause = time.monotonic() + seconds, 0.02
    while not (found := condition()):
        assert time.monotonic() < deadline, f"the condition is still false after {seconds} s"
        time.sleep(pause)
        # A condition may ask a service or read all processes: a long wait asks less often.
        pause = min(1.2 * pause, 0.1)
    return found
