"""`supervise` with small child processes that record events in a journal."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from islands_service.supervisor import DataDirLockedError, DataDirSharedError, folder_lock
from support.processes import alive, eventually

pytestmark = pytest.mark.ci

#: Runs roles until it ends, with some constants of the supervisor changed.
DRIVER = """
import json, os, signal, sys
from pathlib import Path
from islands_service import supervisor
roles, constants = map(json.loads, sys.argv[1:])
for name, value in constants.items():
    assert hasattr(supervisor, name)
    setattr(supervisor, name, value)
for role in roles:
    role["orphaned"] = signal.Signals(role.get("orphaned", signal.SIGTERM))
    role["address"] = Path(role["address"]) if "address" in role else None
sys.exit(supervisor.supervise([supervisor.Role(**role) for role in roles], os.environ))
"""

#: Functions of every child: write to the journal, send a heartbeat, and run until SIGTERM.
CHILD = """
import os, signal, sys, time
def note(what, name=sys.argv[1]):
    with open(os.environ["JOURNAL"], "a") as journal:
        journal.write(f"{time.monotonic():.4f} {name} {what} {os.getpid()}\\n")
def heartbeat():
    os.write(int(os.environ["ISLANDS_LIFELINE"]), b".")
def wait(what):
    while what not in open(os.environ["JOURNAL"]).read():
        time.sleep(0.005)
def stay(end=lambda: None):
    def ended(*_):
        note("signalled")
        end()
        note("end")
        os._exit(0)
    signal.signal(signal.SIGTERM, ended)
    note("start")
    heartbeat()
    while True:
        time.sleep(0.05)
        LIVE()
LIVE = heartbeat
"""

#: Constants that reduce a test to tenths of a second.
FAST = {"_POLL_SECONDS": 0.01, "_FIRST_BACKOFF": 0.05, "_STABLE_AFTER": 5.0, "_API_HEAD_START": 60.0}


class Supervised:
    """A supervisor in a separate process, and the journal of its children."""

    def __init__(self, folder: Path, roles: list[dict[str, Any]], constants: dict[str, float]) -> None:
        self.journal = folder / "journal"
        self.journal.touch()
        self.process = subprocess.Popen(
            [sys.executable, "-c", DRIVER, json.dumps(roles), json.dumps({**FAST, **constants})],
            env={**os.environ, "JOURNAL": str(self.journal)},
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def entries(self, what: str = "", name: str = "") -> list[tuple[float, str, str, int]]:
        """Entries of the journal: time, role, event and process id."""
        lines = [line.split() for line in self.journal.read_text().splitlines()]
        found = [(float(at), role, kind, int(pid)) for at, role, kind, pid in lines]
        return [entry for entry in found if what in ("", entry[2]) and name in ("", entry[1])]

    def started(self, count: int = 1, name: str = "") -> list[tuple[float, str, str, int]]:
        """Wait until children have started ``count`` times."""
        found = eventually(lambda: len(got := self.entries("start", name)) >= count and got, seconds=20.0)
        return list(found)  # type: ignore[call-overload]

    def note(self, what: str) -> None:
        """Add an entry to the journal."""
        with self.journal.open("a") as journal:
            journal.write(f"{time.monotonic():.4f} test {what} 0\n")

    def order(self, *kinds: str) -> list[str]:
        return [f"{role} {kind}" for _, role, kind, _ in self.entries() if kind in kinds]

    def end(self, number: signal.Signals = signal.SIGTERM) -> str:
        """Send a signal, and return the output of the supervisor."""
        self.process.send_signal(number)
        return self.said()

    def said(self) -> str:
        _, said = self.process.communicate(timeout=20)
        return said


Start = Callable[..., Supervised]


@pytest.fixture
def supervised(tmp_path: Path) -> Iterator[Start]:
    """Start a supervisor; all of its children have ended after the test."""
    running: list[Supervised] = []

    def start(*roles: dict[str, Any], **constants: float) -> Supervised:
        running.append(Supervised(tmp_path, list(roles), constants))
        return running[-1]

    yield start
    for each in running:
        if each.process.poll() is None:
            each.end()
        eventually(lambda each=each: not alive({pid for *_, pid in each.entries()} - {0}))


def role(name: str, script: str = "stay()", patience: float = 60.0, **more: Any) -> dict[str, Any]:
    command = [sys.executable, "-S", "-E", "-c", CHILD + script, name]
    return {"name": name, "command": command, "patience": patience, **more}


def test_role_that_exits_is_restarted(supervised: Start) -> None:
    script = "if open(os.environ['JOURNAL']).read().count('start') < 3: note('start'); sys.exit(7)\nstay()"
    running = supervised(role("api", script))
    pids = {pid for *_, pid in running.started(3)}
    assert len(pids) >= 3
    assert "islands serve: api ended (7): it is started again" in running.end()
    assert running.process.returncode == 0


def test_separate_environment_and_descriptors_of_a_role_outlast_a_restart(
    supervised: Start, tmp_path: Path
) -> None:
    script = """
note("own" if set(os.environ) <= {"JOURNAL", "ISLANDS_LIFELINE", "ERRORS", "LC_CTYPE"} else "foreign")
os.write(int(os.environ["ERRORS"]), b"written\\n")
if len(open(os.environ["JOURNAL"]).read().split("own")) < 3: sys.exit(7)
stay()
"""
    environment = {"JOURNAL": str(tmp_path / "journal")}
    running = supervised(role("api", script, environment=environment, descriptors={"ERRORS": 2}))
    running.started()
    assert running.order("own", "foreign") == ["api own"] * 2
    assert running.end().count("written") == 2


def test_role_without_heartbeats_is_killed_and_restarted(supervised: Start) -> None:
    running = supervised(role("api", "LIVE = lambda: None\nstay()", patience=0.3))
    (first, _, _, pid), (second, *_) = running.started(2)[:2]
    assert second - first > 0.3
    assert not alive([pid])
    assert re.search(r"api has sent no heartbeat for \d+\.\d s", running.end())


def test_other_roles_wait_for_the_first_heartbeat_of_the_api(supervised: Start) -> None:
    slow = role("api", "note('start'); time.sleep(0.5); note('ready'); stay()")
    running = supervised(slow, role("work"))
    running.started(1, "work")
    assert running.order("start", "ready")[:2] == ["api start", "api ready"]


def test_misconfigured_role_ends_all_roles_and_the_supervisor(supervised: Start) -> None:
    refusing = role("api", "note('start'); heartbeat(); wait('work start'); sys.exit(2)")
    running = supervised(refusing, role("work"))
    assert "started again" not in running.said()
    assert running.process.returncode == 2
    assert running.order("signalled", "end") == ["work signalled", "work end"]


@pytest.mark.parametrize("heartbeat", ["heartbeat(); ", ""])
def test_role_that_always_fails_at_its_start_ends_the_supervisor(supervised: Start, heartbeat: str) -> None:
    """A coordinator sends heartbeats before its first error."""
    running = supervised(role("api"), role("work", f"note('start'); {heartbeat}sys.exit(7)"))
    said = running.said()
    assert running.process.returncode == 1
    assert said.count("work ended (7): it is started again") == 4
    assert said.splitlines()[-1] == (
        "islands serve: work has ended 5 times at its start (7): correct the error that it has printed "
        "above, and start the service again"
    )
    assert len(running.entries("start", "work")) == 5
    assert running.order("signalled", "end") == ["api signalled", "api end"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signal_ends_the_roles_one_after_the_other_in_order(
    supervised: Start, number: signal.Signals
) -> None:
    drains = "stay(lambda: time.sleep(0.2))"
    running = supervised(role("api", drains), role("work", drains), role("ray", drains))
    running.started(3)
    assert running.end(number) == ""
    assert running.process.returncode == 0
    signalled = [f"{name} {what}" for name in ("api", "work", "ray") for what in ("signalled", "end")]
    assert running.order("signalled", "end") == signalled


def test_role_that_does_not_end_is_killed(supervised: Start) -> None:
    stubborn = role("api", "stay(lambda: time.sleep(60))")
    running = supervised(stubborn, role("work"), _SHUTDOWN_GRACE=0.3)
    running.started(2)
    assert "api does not end: it is killed" in running.end()
    assert running.process.returncode == 0
    assert running.order("signalled", "end") == ["api signalled", "work signalled", "work end"]


def test_killed_supervisor_sends_each_role_its_parent_death_signal(supervised: Start) -> None:
    running = supervised(role("api", orphaned=int(signal.SIGKILL)), role("work"))
    running.started(2)
    running.process.kill()
    running.said()
    eventually(lambda: not alive({pid for *_, pid in running.entries()}))
    assert running.order("signalled", "end") == ["work signalled", "work end"]


def test_descendants_of_a_role_are_killed_with_it(supervised: Start) -> None:
    """Ray's processes, and inspections of files: no other process would end them."""
    leaves = (
        "note('start'); heartbeat()\n"
        "if os.fork() == 0: note('left', 'grandchild')\n"
        "while True: time.sleep(0.05)"
    )
    running = supervised(role("ray", leaves))
    for number in (signal.SIGKILL, signal.SIGTERM):
        pids = {pid for *_, pid in eventually(lambda: running.entries("left", "grandchild"))}  # type: ignore[attr-defined]
        os.kill(running.entries("start")[-1][3], number)
        eventually(lambda pids=pids: not alive(pids))
        running.started(2)
    running.end()
    assert not alive({pid for *_, pid in running.entries()})


def test_roles_share_one_ray_token_that_differs_between_services(
    supervised: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("RAY_AUTH_TOKEN", raising=False)  # a given token takes precedence
    script = "note('token-' + os.environ['RAY_AUTH_TOKEN']); stay()"
    tokens = []
    for _ in range(2):
        running = supervised(role("api", script), role("work", script))
        running.started(2)
        tokens.append({kind for _, _, kind, _ in running.entries() if kind.startswith("token")})
        running.end()
        running.journal.unlink()
        running.journal.touch()
    assert [len(found) for found in tokens] == [1, 1]
    assert tokens[0] != tokens[1]
    assert len(tokens[0].pop()) == len("token-") + 32


def test_folder_that_other_users_may_enter_is_made_private(tmp_path):
    """The database in it has the mode of an ordinary file."""
    folder = tmp_path / "data"
    folder.mkdir()
    folder.chmod(0o755)
    with folder_lock(folder):
        assert folder.stat().st_mode & 0o777 == 0o700


def test_folder_for_the_files_of_all_users_is_refused(tmp_path):
    tmp_path.chmod(0o1777)
    with pytest.raises(DataDirSharedError, match=r"mode 1777.*--data-dir"), folder_lock(tmp_path):
        pass
    assert tmp_path.stat().st_mode & 0o1777 == 0o1777
    tmp_path.chmod(0o700)


def test_data_folder_is_locked_by_one_service(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    with folder_lock(folder):
        assert folder.stat().st_mode & 0o077 == 0
        with (
            pytest.raises(DataDirLockedError, match=f"process {os.getpid()}.*another --data-dir"),
            folder_lock(folder),
        ):
            pass
    with folder_lock(folder):
        pass


def test_lock_of_a_killed_service_is_released(tmp_path: Path) -> None:
    script = (
        "import sys, time; from pathlib import Path; from islands_service.supervisor import folder_lock\n"
        "with folder_lock(Path(sys.argv[1])): print('mine', flush=True); time.sleep(60)"
    )
    command = [sys.executable, "-c", script, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as owner:
        assert owner.stdout is not None
        assert owner.stdout.readline() == "mine\n"
        with pytest.raises(DataDirLockedError, match=f"process {owner.pid}"), folder_lock(tmp_path):
            pass
        owner.kill()
        owner.wait()
        with folder_lock(tmp_path):
            assert (tmp_path / "lock").read_text() == f"{os.getpid()}\n"
