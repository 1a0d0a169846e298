"""Processes by their number: who descends from whom, read from /proc."""

import os
import signal
import time
from collections.abc import Callable, Iterable
from pathlib import Path


def descendants(pid: int) -> dict[int, str]:
    """The children of a process and theirs, each with its command line."""
    parents, lines = {}, {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            try:
                state = (folder / "stat").read_text()
                lines[int(folder.name)] = (folder / "cmdline").read_text().replace("\0", " ")
            except OSError:  # it has ended meanwhile
                continue
            parents[int(folder.name)] = int(state.rpartition(")")[2].split()[1])
    found, edge = {}, {pid}
    while edge:
        edge = {child for child, parent in parents.items() if parent in edge} - found.keys()
        found |= {child: lines[child] for child in edge}
    return found


def actors(pid: int | None = None) -> list[int]:
    """The island actors that a process has started, this one by default."""
    return [child for child, line in descendants(pid or os.getpid()).items() if "IslandActor" in line]


def alive(pids: Iterable[int]) -> list[int]:
    """Those that have not ended; one that nobody has asked for its end yet has ended."""
    return [pid for pid in pids if _state(pid) not in ("", "Z")]


def _state(pid: int) -> str:
    """The letter of a process's state; "" where there is no such process."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:  # it may end while it is looked at
        return ""


def kill(pid: int) -> None:
    os.kill(pid, signal.SIGKILL)


def eventually(what: Callable[[], object], seconds: float = 60.0) -> object:
    """Wait until something is true, and return it."""
    deadline = time.monotonic() + seconds
    while not (found := what()):
        assert time.monotonic() < deadline, "it never came true"
        time.sleep(0.02)
    return found
