"""`block_sigint`: processes start with SIGINT blocked, and the process that starts them receives it again."""

import subprocess
import sys

CODE = """
from multiprocessing import get_context
from signal import SIG_BLOCK, SIGINT, pthread_sigmask
from islands.processes.blocked_signals import block_sigint

process = get_context("spawn").Process(target=print)  # the first process, which starts the resource tracker
with block_sigint():
    process.start()
    status = open(f"/proc/{process.pid}/status").read()
process.join()
blocked = int(status.partition("SigBlk:")[2].split()[0], 16)
print(bool(blocked & 1 << SIGINT - 1), SIGINT in pthread_sigmask(SIG_BLOCK, ()))
"""


def test_process_starts_with_sigint_blocked() -> None:
    done = subprocess.run(
        [sys.executable, "-c", CODE], check=True, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.split() == ["True", "False"]
