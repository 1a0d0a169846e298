"""Backoff and timeouts of the supervisor, with a clock that the test controls."""

import io
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from islands_service import supervisor
from islands_service.supervisor import Role
from support.processes import alive, eventually

#: Children: one that exits at once, one without heartbeats, one with continuous heartbeats.
ENDS = "pass"
SILENT = "import signal; signal.pause()"
LIVE = """
import os, time
while True:
    os.write(int(os.environ["ISLANDS_LIFELINE"]), b".")
    time.sleep(0.005)
"""
#: Reads pages of a file from the disk, as of a library under memory pressure, until the file is deleted.
READING = """
import mmap, os, signal, sys
os.write(int(os.environ["ISLANDS_LIFELINE"]), b".")
place = 0
while os.path.exists(sys.argv[1]):
    with open(sys.argv[1], "rb") as file:
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as pages:
            pages[place]
        place = (place + 1_000_000) % 8_000_000
signal.pause()
"""
ONE_HEARTBEAT = f"import os; os.write(int(os.environ['ISLANDS_LIFELINE']), b'.'); {SILENT}"


class ControlledRole:
    """A role that is checked at times chosen by the test."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, script: str, patience: float, *arguments: str
    ) -> None:
        self.now, self.log = 1000.0, io.StringIO()
        self.role = Role("api", [sys.executable, "-S", "-E", "-c", script, *arguments], patience)
        monkeypatch.setattr(supervisor, "monotonic", lambda: self.now)
        self.check()

    def check(self, seconds: float = 0.0) -> None:
        """Advance the clock and check the role."""
        self.now += seconds
        supervisor._check_role(self.role, [self.role], os.environ, self.now, self.log)

    @property
    def runs(self) -> bool:
        return self.role.process is not None

    def ended(self, after: float) -> None:
        """Wait until the process has exited, and check the role the given seconds later."""
        process = self.role.process
        assert process is not None
        if alive([process.pid]):
            eventually(lambda: process.poll() is not None)
        self.check(after)
        assert not self.runs

    def waits(self, seconds: float) -> bool:
        """Return whether the next start comes after the given seconds, and not earlier."""
        self.check(seconds - 0.001)
        early = self.runs
        self.check(0.002)
        return self.runs and not early

    def wait_for_heartbeat(self) -> None:
        """Wait until a heartbeat is received at the current time."""

        def received() -> bool:
            self.check()
            return self.role.last_heartbeat == self.now

        eventually(received)


StartRole = Callable[..., ControlledRole]


@pytest.fixture
def start_role(monkeypatch: pytest.MonkeyPatch) -> Iterator[StartRole]:
    """Start a role; its process is killed after the test."""
    made: list[ControlledRole] = []

    def start(script: str, patience: float = 60.0, *arguments: str) -> ControlledRole:
        made.append(ControlledRole(monkeypatch, script, patience, *arguments))
        return made[-1]

    yield start
    for each in made:
        if each.role.process is not None:
            each.role.process.kill()
            each.ended(0.0)


def test_backoff_doubles_with_every_exit_up_to_a_limit(
    start_role: StartRole, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "_MAX_BACKOFF", 0.8)
    role = start_role(ENDS)
    for expected in (0.2, 0.4, 0.8, 0.8):
        role.ended(0.1)
        assert role.waits(expected), expected


@pytest.mark.parametrize("stopped", [False, True], ids=["silent", "stopped"])
def test_role_without_heartbeats_is_killed_after_its_timeout(start_role: StartRole, stopped: bool) -> None:
    role = start_role(LIVE if stopped else ONE_HEARTBEAT, patience=5.0)
    role.wait_for_heartbeat()
    process = role.role.process
    assert process is not None
    if stopped:
        os.kill(process.pid, signal.SIGSTOP)
        role.check()  # read the earlier heartbeats
    role.check(4.9)
    assert alive([process.pid])
    role.check(0.2)
    role.ended(0.1)
    assert process.returncode == -signal.SIGKILL
    assert "api has sent no heartbeat for 5.1 s: it is started again" in role.log.getvalue()


def stat(pid: int) -> list[str]:
    """Return the fields of the state of a process, from its state letter on."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()


def wait_for_page_faults(pid: int) -> None:
    """Wait until a process has read a page from a disk."""
    before = stat(pid)[9]
    eventually(lambda: stat(pid)[9] != before, seconds=15.0)


def test_silent_role_that_reads_pages_from_a_disk_is_killed_after_they_are_read(
    start_role: StartRole, tmp_path: Path
) -> None:
    """The thread that waits for a page of a library has the lock of the interpreter."""
    role = start_reader(start_role, tmp_path)
    process = role.role.process
    assert process is not None
    for _ in range(3):
        role.check(5.1)
        assert role.log.getvalue() == ""
        wait_for_page_faults(process.pid)
    (tmp_path / "pages").unlink()
    eventually(lambda: stat(process.pid)[0] == "S")
    role.check(5.1)  # the pages that it has read meanwhile
    role.check(5.1)
    role.ended(0.1)
    assert "api has sent no heartbeat for 25.5 s: it is started again" in role.log.getvalue()


def start_reader(start_role: StartRole, folder: Path) -> ControlledRole:
    """Start a role that reads pages from a disk; it has sent a heartbeat before."""
    file = folder / "pages"
    file.write_bytes(os.urandom(8_000_001))
    with file.open("rb") as written:
        os.fsync(written.fileno())
    role = start_role(READING, 5.0, str(file))
    role.wait_for_heartbeat()
    assert role.role.process is not None
    try:
        wait_for_page_faults(role.role.process.pid)
    except AssertionError:
        pytest.skip("the temporary folder is not on a disk")
    return role


def test_silence_is_reported_once_until_the_process_is_gone(
    start_role: StartRole, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A killed process that waits for a disk ends after the disk has answered."""
    role = start_role(ONE_HEARTBEAT, patience=5.0)
    for silences in (1, 2):
        role.wait_for_heartbeat()
        process = role.role.process
        assert process is not None
        with monkeypatch.context() as disk:
            disk.setattr(process, "kill", lambda: None)
            role.check(5.1)
            for _ in range(3):
                role.check(0.06)
        process.kill()
        role.ended(supervisor._STABLE_AFTER)
        role.check()
        assert role.log.getvalue().count("has sent no heartbeat") == silences
        assert role.log.getvalue().count("ended (-9): it is started again") == silences
