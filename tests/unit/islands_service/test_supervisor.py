"""The supervisor, with tiny children that write down in a journal what happens to them."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from islands_service.supervisor import DataDirLockedError, folder_lock
from support.processes import alive, eventually

#: Runs roles until it is told to end, with some of the supervisor's constants changed.
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

#: What every child can do: write in the journal, give a sign of life, and stay until SIGTERM.
CHILD = """
import os, signal, sys, time
def note(what, name=sys.argv[1]):
    with open(os.environ["JOURNAL"], "a") as journal:
        journal.write(f"{time.monotonic():.4f} {name} {what} {os.getpid()}\\n")
def sign():
    os.write(int(os.environ["ISLANDS_LIFELINE"]), b".")
def wait(what):
    while what not in open(os.environ["JOURNAL"]).read():
        time.sleep(0.005)
def stay(end=lambda: None):
    def ended(*_):
        note("told")
        end()
        note("end")
        os._exit(0)
    signal.signal(signal.SIGTERM, ended)
    note("start")
    sign()
    while True:
        time.sleep(0.05)
        LIVE()
LIVE = sign
"""

#: Constants that make a test take tenths of a second.
FAST = {"_LOOK": 0.01, "_BACKOFF": 0.05, "_PROVEN": 5.0, "_API_FIRST": 5.0}


class Supervised:
    """A supervisor in a process of its own, and the journal of its children."""

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
        """What children have written down: when, who, what, and the process."""
        lines = [line.split() for line in self.journal.read_text().splitlines()]
        found = [(float(at), who, kind, int(pid)) for at, who, kind, pid in lines]
        return [entry for entry in found if what in ("", entry[2]) and name in ("", entry[1])]

    def started(self, count: int = 1, name: str = "") -> list[tuple[float, str, str, int]]:
        """Wait until children have started so often."""
        found = eventually(lambda: len(got := self.entries("start", name)) >= count and got, seconds=20.0)
        return list(found)  # type: ignore[call-overload]

    def order(self, *kinds: str) -> list[str]:
        return [f"{who} {kind}" for _, who, kind, _ in self.entries() if kind in kinds]

    def end(self, number: signal.Signals = signal.SIGTERM) -> str:
        """End it, and return what it has said."""
        self.process.send_signal(number)
        return self.said()

    def said(self) -> str:
        _, said = self.process.communicate(timeout=20)
        return said


Start = Callable[..., Supervised]


@pytest.fixture
def supervised(tmp_path: Path) -> Iterator[Start]:
    """Start a supervisor; none of its children is left at the end."""
    running: list[Supervised] = []

    def start(*roles: dict[str, Any], **constants: float) -> Supervised:
        running.append(Supervised(tmp_path, list(roles), constants))
        return running[-1]

    yield start
    for each in running:
        if each.process.poll() is None:
            each.end()
        eventually(lambda each=each: not alive({pid for *_, pid in each.entries()}))


def role(name: str, script: str = "stay()", patience: float = 60.0, **more: Any) -> dict[str, Any]:
    command = [sys.executable, "-S", "-E", "-c", CHILD + script, name]
    return {"name": name, "command": command, "patience": patience, **more}


def test_who_ends_is_started_again(supervised: Start) -> None:
    running = supervised(role("doors", "note('start'); sys.exit(7)"))
    pids = {pid for *_, pid in running.started(3)}
    assert len(pids) >= 3
    assert "islands serve: doors ended (7): it is started again" in running.end()
    assert running.process.returncode == 0


def test_who_says_nothing_any_more_is_taken_for_hanging(supervised: Start) -> None:
    running = supervised(role("doors", "LIVE = lambda: None\nstay()", patience=0.3))
    (first, _, _, pid), (second, *_) = running.started(2)[:2]
    assert second - first > 0.3
    assert not alive([pid])
    assert "doors has said nothing for 0." in running.end()


def test_the_others_wait_for_the_first_sign_of_the_first_one(supervised: Start) -> None:
    slow = role("doors", "note('start'); time.sleep(0.5); note('ready'); stay()")
    running = supervised(slow, role("work"))
    running.started(1, "work")
    assert running.order("start", "ready")[:2] == ["doors start", "doors ready"]


def test_the_others_do_not_wait_for_ever(supervised: Start) -> None:
    running = supervised(role("doors", "note('start'); time.sleep(60)"), role("work"), _API_FIRST=0.3)
    running.started(1, "work")


def test_who_cannot_go_on_without_another_is_started_again_with_it(supervised: Start) -> None:
    roles = (role("doors"), role("work", needs=["ray"]), role("ray"))
    running = supervised(*roles)
    running.started(3)
    before = {who: pid for _, who, _, pid in running.entries("start")}
    os.kill(before["ray"], signal.SIGKILL)
    running.started(2, "ray")
    running.started(2, "work")
    assert not alive([before["work"], before["ray"]])
    assert len(running.entries("start", "doors")) == 1
    # The other way round nobody else is concerned.
    os.kill(running.entries("start", "work")[-1][3], signal.SIGKILL)
    running.started(3, "work")
    assert len(running.entries("start", "ray")) == 2


def test_where_one_says_that_it_cannot_run_so_all_end_and_so_does_the_supervisor(supervised: Start) -> None:
    refusing = role("doors", "note('start'); sign(); wait('work start'); sys.exit(2)")
    running = supervised(refusing, role("work"))
    assert "started again" not in running.said()
    assert running.process.returncode == 2
    assert running.order("told", "end") == ["work told", "work end"]


def test_one_that_has_run_so_before_and_now_cannot_is_started_again_until_it_can(supervised: Start) -> None:
    """The doors, whose last key has expired: it is no reason to end the jobs."""
    script = (
        "count = open(os.environ['JOURNAL']).read().count('doors start')\n"
        "if count in (1, 2): note('start'); sys.exit(2)\n"
        "stay()"
    )
    running = supervised(role("doors", script), role("work"), _BACKOFF=0.05)
    running.started(1, "work")
    os.kill(running.started(1, "doors")[0][3], signal.SIGKILL)
    running.started(4, "doors")
    assert len(running.entries("start", "work")) == 1
    assert running.end().count("doors ended (2): it is started again") == 2
    assert running.process.returncode == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_told_to_end_it_ends_all_in_their_order_each_after_the_one_before(
    supervised: Start, number: signal.Signals
) -> None:
    drains = "stay(lambda: time.sleep(0.2))"
    running = supervised(role("doors", drains), role("work", drains), role("ray", drains))
    running.started(3)
    assert running.end(number) == ""
    assert running.process.returncode == 0
    told = [f"{name} {what}" for name in ("doors", "work", "ray") for what in ("told", "end")]
    assert running.order("told", "end") == told


def test_who_does_not_end_is_ended(supervised: Start) -> None:
    stubborn = role("doors", "stay(lambda: time.sleep(60))")
    running = supervised(stubborn, role("work"), _GRACE=0.3)
    running.started(2)
    assert "doors does not end: it is ended" in running.end()
    assert running.process.returncode == 0
    assert running.order("told", "end") == ["doors told", "work told", "work end"]


def test_ctrl_c_in_the_terminal_does_not_reach_the_children(supervised: Start) -> None:
    running = supervised(
        role("doors", "signal.signal(signal.SIGINT, lambda *_: note('interrupted'))\nstay()")
    )
    running.started()
    os.killpg(running.process.pid, signal.SIGINT)
    running.said()
    assert running.order("told", "interrupted", "end") == ["doors told", "doors end"]


def test_where_the_supervisor_is_killed_the_children_are_told_as_they_asked_for(supervised: Start) -> None:
    running = supervised(role("doors", orphaned=int(signal.SIGKILL)), role("work"))
    running.started(2)
    running.process.kill()
    running.said()
    eventually(lambda: not alive({pid for *_, pid in running.entries()}))
    assert running.order("told", "end") == ["work told", "work end"]


def test_whom_a_child_leaves_behind_is_ended_with_it(supervised: Start) -> None:
    """Ray's processes, and files that are being read: nobody is there any more who would end them."""
    leaves = (
        "note('start'); sign()\nif os.fork() == 0: note('left', 'grandchild')\nwhile True: time.sleep(0.05)"
    )
    running = supervised(role("ray", leaves))
    for number in (signal.SIGKILL, signal.SIGTERM):
        pids = {pid for *_, pid in eventually(lambda: running.entries("left", "grandchild"))}  # type: ignore[attr-defined]
        os.kill(running.entries("start")[-1][3], number)
        eventually(lambda pids=pids: not alive(pids))
        running.started(2)
    running.end()
    assert not alive({pid for *_, pid in running.entries()})


def test_a_file_that_says_how_a_child_is_reached_goes_with_the_child(
    supervised: Start, tmp_path: Path
) -> None:
    address = tmp_path / "address"
    script = "note('start'); sign()\nwhile True: time.sleep(0.05)"
    running = supervised(role("ray", script, address=str(address)))
    pid = running.started()[0][3]
    address.write_text("where it was")
    os.kill(pid, signal.SIGKILL)
    eventually(lambda: not address.exists())


def test_children_have_one_secret_for_ray_and_every_service_another(
    supervised: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("RAY_AUTH_TOKEN", raising=False)  # one that is given counts
    script = "note('token-' + os.environ['RAY_AUTH_TOKEN']); stay()"
    tokens = []
    for _ in range(2):
        running = supervised(role("doors", script), role("work", script))
        running.started(2)
        tokens.append({kind for _, _, kind, _ in running.entries() if kind.startswith("token")})
        running.end()
        running.journal.unlink()
        running.journal.touch()
    assert [len(found) for found in tokens] == [1, 1]
    assert tokens[0] != tokens[1]
    assert len(tokens[0].pop()) == len("token-") + 32


def test_starting_again_and_again_takes_no_more_and_more_files(supervised: Start) -> None:
    running = supervised(role("doors", "note('start')"), _BACKOFF=0.01, _MOST_BACKOFF=0.01)
    files = Path(f"/proc/{running.process.pid}/fd")
    running.started(3)
    before = len(list(files.iterdir()))
    running.started(10)
    # A child may be just starting.
    eventually(lambda: len(list(files.iterdir())) <= before + 1)


def test_a_pipe_that_nobody_reads_holds_no_child_up(supervised: Start) -> None:
    flood = (
        "note('start'); time.sleep(0.3)\n"
        "for _ in range(20_000):\n"
        "    try: os.write(int(os.environ['ISLANDS_LIFELINE']), b'.' * 64)\n"
        "    except BlockingIOError: pass\n"
        "note('done'); stay()"
    )
    running = supervised(role("doors", flood), role("work"))
    running.started()
    os.kill(running.process.pid, signal.SIGSTOP)
    try:
        eventually(lambda: running.entries("done"))
    finally:
        os.kill(running.process.pid, signal.SIGCONT)
    running.started(1, "work")


def test_a_folder_belongs_to_one_service(tmp_path: Path) -> None:
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


def test_the_lock_of_a_killed_service_is_free(tmp_path: Path) -> None:
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
