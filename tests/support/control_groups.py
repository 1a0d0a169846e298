"""Control groups of the kernel that limit the memory of a process; only root can make them."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from support.processes import eventually

#: Folder of the memory groups, and the file of their limit, of both versions of control groups.
VERSIONS = (
    (Path("/sys/fs/cgroup/memory"), "memory.limit_in_bytes"),
    (Path("/sys/fs/cgroup"), "memory.max"),
)


@contextmanager
def memory_limit(pid: int, limit: int) -> Iterator[None]:
    """Limit the bytes that a process allocates from now on. Beyond them the kernel kills it."""
    for root, name in VERSIONS:
        folder = root / f"islands-test-{os.getpid()}"
        members = folder / "cgroup.procs"
        try:
            folder.mkdir()
        except OSError:
            continue
        try:
            if (folder / name).exists():
                (folder / name).write_text(str(limit))
                members.write_text(str(pid))
                yield
                eventually(lambda members=members: not members.read_text())  # type: ignore[misc]
                return
        finally:
            folder.rmdir()
    pytest.skip("this machine permits no control groups: run as root on a machine with them")
