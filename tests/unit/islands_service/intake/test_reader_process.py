"""`ForkServer`: it starts again after its end, and ends with its client."""

import os
import signal
import subprocess
import sys

import pytest

from islands_service.intake.reader_process import open_memory
from support.processes import alive, descendants, eventually, kill

pytestmark = pytest.mark.ci

#: Reads a file of the first argument until it is killed.
CLIENT = """
import sys
from pathlib import Path
from islands_service.intake.record_reading import RecordRequest, read_confined
read_confined(Path(sys.argv[1]), RecordRequest(["u"], "y", None, None, {}), 6_000_000_000, 600.0)
"""


def start(server, output):
    return server.start("record_reading", b"{}", output.fileno(), output.fileno())


def find_servers(pid):
    return [child for child, line in descendants(pid).items() if "intake.fork_server" in line]


def test_a_server_that_has_ended_is_started_again(programs):
    server = programs("import os; print(os.getppid(), flush=True)")
    pids = []
    for _ in range(2):
        with open_memory("answer") as output:
            with start(server, output) as process:
                assert process.wait(60.0) == 0
            output.seek(0)
            pids.append(int(output.read()))
        kill(pids[-1])
        eventually(lambda: not alive(pids))
    assert pids[0] != pids[1]


def test_a_process_ends_with_its_server(programs):
    server = programs("import os, time; print(os.getpid(), os.getppid(), flush=True); time.sleep(600)")
    with open_memory("answer") as output, start(server, output) as process:
        eventually(lambda: os.fstat(output.fileno()).st_size)
        output.seek(0)
        pid, parent = map(int, output.read().split())
        kill(parent)
        assert process.wait(60.0) == -signal.SIGKILL
        eventually(lambda: not alive([pid]), seconds=10.0)


def test_the_start_of_the_server_is_not_counted(programs):
    with open_memory("answer") as output, start(programs("pass"), output) as process:
        # An interpreter takes longer to start, and to import the readers.
        assert process.wait(0.2) == 0


def test_waiting_has_a_limit_and_a_killed_process_has_ended(programs):
    with open_memory("answer") as output, start(programs("while True: pass"), output) as process:
        with pytest.raises(TimeoutError):
            process.wait(0.5)
        process.kill()
        assert process.wait(60.0) == -signal.SIGKILL


def test_a_killed_client_leaves_no_process(tmp_path):
    os.mkfifo(tmp_path / "a.csv")
    client = subprocess.Popen([sys.executable, "-c", CLIENT, tmp_path / "a.csv"])
    try:
        (server,) = eventually(lambda: find_servers(client.pid)[:1])
        children = [server, *eventually(lambda: descendants(server))]
    finally:
        client.kill()
        client.wait()
    eventually(lambda: not alive(children), seconds=10.0)
