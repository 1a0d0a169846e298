"""Commands in processes: exit codes, CPU time, and their end by a check or an error."""

import os
import sys
import time
from pathlib import Path

import pytest

from islands.processes.limited_command import run_command


def run(tmp_path, program, **options):
    return run_command([sys.executable, "-I", "-S", "-c", program], tmp_path / "log", **options)


def test_a_command_has_its_exit_code_its_output_and_its_cpu_time(tmp_path):
    program = "import sys, time\nwhile time.process_time() < 0.1: pass\nprint('shown')\nsys.exit('failed')"
    ended = run(tmp_path, program)
    assert (ended.code, ended.is_stopped, ended.exceeds_cpu) == (1, False, False)
    assert 0.1 <= ended.cpu_s < 2.0
    assert ended.wall_s >= ended.cpu_s
    assert sorted((tmp_path / "log").read_text().split()) == ["failed", "shown"]


def test_a_command_that_uses_no_cpu_has_little_cpu_time(tmp_path):
    assert run(tmp_path, "import time; time.sleep(0.3)").cpu_s < 0.2


def test_a_check_ends_a_command_and_the_processes_that_it_has_started(tmp_path):
    program = "import os, time\nprint(os.getpid() if os.fork() else os.getpid(), flush=True)\ntime.sleep(60)"
    log = tmp_path / "log"
    ended = run(tmp_path, program, must_end=lambda _wall_s: len(log.read_text().split()) == 2)
    assert ended.is_stopped
    assert ended.code == -9
    for process in map(int, log.read_text().split()):
        _wait_for_end(process)


def test_processes_that_a_command_has_started_end_with_it(tmp_path):
    program = (
        "import os, time\nstarted = os.fork()\nif started: print(started, flush=True)\nelse: time.sleep(60)"
    )
    assert run(tmp_path, program).code == 0
    _wait_for_end(int((tmp_path / "log").read_text()))


def test_an_error_of_the_check_ends_the_command(tmp_path):
    log = tmp_path / "log"

    def check(_wall_s):
        if log.read_text():
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, "import os, time\nprint(os.getpid(), flush=True)\ntime.sleep(60)", must_end=check)
    _wait_for_end(int(log.read_text()))


def _wait_for_end(process):
    """Wait until a process does not run: it is absent, or a zombie that its parent does not wait for."""
    for _ in range(200):
        try:
            os.kill(process, 0)
            if Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return
        except (ProcessLookupError, FileNotFoundError):
            return
        time.sleep(0.02)
    pytest.fail(f"process {process} still runs")
