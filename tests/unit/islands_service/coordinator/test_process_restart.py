"""`restart_process`: the same process starts again, also during a computation."""

import os
import subprocess
import sys

from support.processes import alive

#: Starts a child process, opens a pipe, and restarts while the main thread computes. The second start prints
#: which of its descriptors are open.
SCRIPT = """
import os, subprocess, sys
from threading import Timer
from islands_service.coordinator.process_restart import restart_process
lifeline, marker = int(sys.argv[1]), sys.argv[2]
if os.path.exists(marker):
    child, other, pid = open(marker).read().split()
    opened = {int(each) for each in os.listdir("/proc/self/fd")}
    print(child, int(other) in opened, int(pid) == os.getpid(), flush=True)
    os.write(lifeline, b"again")
    sys.exit()
child = subprocess.Popen(["sleep", "600"])
other, _ = os.pipe()
other = os.dup2(other, 100, inheritable=True)
with open(marker, "w") as file:
    print(child.pid, other, os.getpid(), file=file)
Timer(0.1, restart_process, (lifeline, None)).start()
while True:
    pass
"""


def test_restart_ends_the_computation_and_keeps_the_process_and_its_lifeline(tmp_path):
    reading, writing = os.pipe()
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    command = [sys.executable, str(script), str(writing), str(tmp_path / "marker")]
    ended = subprocess.run(
        command, pass_fds=(writing,), capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == 0, ended.stderr
    child, other_is_open, is_same_process = ended.stdout.split()
    assert (other_is_open, is_same_process) == ("False", "True")
    assert not alive([int(child)])
    assert os.read(reading, 6) == b"sagain"
    for each in (reading, writing):
        os.close(each)
