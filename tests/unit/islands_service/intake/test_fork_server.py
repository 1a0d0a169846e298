"""Fork server: warm, single-threaded, and without anything that a forked process must not have."""

import json
import sys

import pytest

from islands_service.intake.confined_process import REQUESTS, make_message
from islands_service.intake.fork_server import _PRELOADED
from islands_service.intake.reader_process import open_memory

pytestmark = pytest.mark.ci

#: Prints what a forked process has before its confinement: open files, environment, modules, threads.
STATE = """
import json, os, sys
server = f"/proc/{os.getppid()}"
opened = sorted(int(each) for each in os.listdir("/proc/self/fd") if os.path.exists(f"/proc/self/fd/{each}"))
print(json.dumps({
    "opened": opened, "modules": list(sys.modules), "server": server, "pid": os.getpid(),
    "files": [os.readlink(f"{server}/fd/{each}") for each in os.listdir(f"{server}/fd")],
    "threads": len(os.listdir(f"{server}/task")), "environment": dict(os.environ),
}), flush=True)
"""

#: Restricts itself as every reader does, then tries what a harmful file may try.
ATTACKS = """
import json, os, socket, sys
from islands_service.intake.confined_process import enter
path, asked, answer = enter(writes=True)
server = os.getppid()
actions = {
    "read another file": lambda: open(asked["other"]).read(),
    "write the file": lambda: open(path, "r+"),
    "make a file": lambda: open(asked["other"] + "x", "w"),
    "read the memory of the server": lambda: open(f"/proc/{server}/mem", "rb").read(1),
    "read the environment of the server": lambda: open(f"/proc/{server}/environ").read(),
    "open a socket": lambda: socket.socket(),
    "fork": os.fork,
    "start a process": lambda: os.execv("/bin/true", ["true"]),
    "signal the server": lambda: os.kill(server, 0),
    "limit the server": lambda: __import__("resource").prlimit(server, 7),
}
done = []
for name, action in actions.items():
    try:
        action()
    except OSError:
        continue
    done.append(name)
answer.write(json.dumps({"read": open(path).read(), "done": done, "tried": len(actions)}).encode())
answer.flush()
"""


def run(server, message=b"{}"):
    """Return the exit status and the answer of a forked process."""
    with open_memory("answer") as output:
        with server.start("record_reading", message, output.fileno(), sys.__stderr__.fileno()) as process:
            status = process.wait(60.0)
        output.seek(0)
        return status, output.read()


def test_a_forked_process_has_standard_streams_and_the_readers_and_nothing_else(programs):
    server = programs(STATE)
    one, other = (json.loads(run(server)[1]) for _ in range(2))
    assert one["opened"] == [0, 1, 2]
    assert set(_PRELOADED) <= set(one["modules"])
    assert (one["server"], one["threads"]) == (other["server"], 1)
    assert one["pid"] != other["pid"]
    # The requests, and the control socket of the running process.
    assert sum(path.startswith("socket:") for path in one["files"]) == 2, one["files"]
    assert not [name for name in one["environment"] if name.startswith("ISLANDS_") and name != REQUESTS]


def test_a_forked_process_can_only_read_its_file(programs, tmp_path):
    given, other = tmp_path / "given.csv", tmp_path / "other.csv"
    given.write_text("1")
    other.write_text("2")
    message = make_message(given, 6_000_000_000, 30.0, {"other": str(other)})
    # One process tries everything: a successful action is in the answer, or its end is in the status.
    status, answer = run(programs(ATTACKS), message)
    assert status == 0
    assert json.loads(answer) == {"read": "1", "done": [], "tried": 10}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["given.csv", "other.csv"]


@pytest.mark.parametrize(
    ("program", "status"),
    [("raise SystemExit(3)", 3), ("raise KeyError('boom')", 1), ("import os; os.kill(os.getpid(), 11)", -11)],
)
def test_the_status_of_a_process_reaches_its_client(programs, program, status):
    assert run(programs(program))[0] == status
