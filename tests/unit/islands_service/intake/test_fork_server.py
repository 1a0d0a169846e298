"""Fork server: warm, single-threaded, and without anything that a forked process must not have."""

import json
import sys

import pytest

from islands_service.intake.confined_process import REQUESTS, make_message
from islands_service.intake.fork_server import _PRELOADED
from islands_service.intake.reader_process import open_memory
from support.oscillator_fmus import compile_oscillator, make_attacks

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

#: Restricts itself as every reader does, then does what a harmful file may let it do.
ATTACKS = """
import ctypes, json
from pathlib import Path
from islands_service.intake.confined_process import enter
path, asked, answer = enter(writes=True, readable=[Path({library!r})])
attack = ctypes.CDLL({library!r}).attack
attack.restype = ctypes.c_char_p
answer.write(json.dumps({{"read": open(path).read(), "done": attack().decode()}}).encode())
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
    data, given, library = tmp_path / "data", tmp_path / "given.csv", tmp_path / "library"
    data.mkdir()
    (data / "database").write_text("jobs")
    given.write_text("1")
    library.write_bytes(compile_oscillator(3, *make_attacks(data)))
    # One process tries everything: a successful attempt is in the answer, or its end is in the status.
    status, answer = run(
        programs(ATTACKS.format(library=str(library))), make_message(given, 6_000_000_000, 30.0, {})
    )
    assert status == 0
    assert json.loads(answer) == {"read": "1", "done": "attempts that succeed:"}


@pytest.mark.parametrize(
    ("program", "status"),
    [("raise SystemExit(3)", 3), ("raise KeyError('boom')", 1), ("import os; os.kill(os.getpid(), 11)", -11)],
)
def test_the_status_of_a_process_reaches_its_client(programs, program, status):
    assert run(programs(program))[0] == status
