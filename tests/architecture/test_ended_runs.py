"""A run of the tests that is terminated ends the processes that its tests have started."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from support.processes import alive, eventually
from support.repository import ROOT

#: A test with a process that its fixture ends.
WAITING = """
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.fixture
def process():
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"]) as started:
        yield started
        started.kill()


def test_waits(process):
    Path("pid").write_text(str(process.pid))
    process.wait()
"""


@pytest.mark.ci
def test_terminated_run_ends_the_processes_of_its_tests(tmp_path: Path) -> None:
    (tmp_path / "test_waiting.py").write_text(WAITING)
    command = [sys.executable, "-m", "pytest", "-p", "conftest", "-p", "no:cacheprovider", "test_waiting.py"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "tests")}
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL) as run:
        eventually(lambda: (tmp_path / "pid").exists() and (tmp_path / "pid").read_text())
        pid = int((tmp_path / "pid").read_text())
        run.send_signal(signal.SIGTERM)
    try:
        assert not alive([pid])
    finally:
        if alive([pid]):
            os.kill(pid, signal.SIGKILL)
