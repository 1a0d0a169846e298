"""`StopRequest`: a signal may arrive at any moment, also during a wait."""

import subprocess
import sys
import time
from threading import Thread

import pytest

from islands_service.liveness import StopRequest

#: Waits for short times while signals arrive continuously.
WAITING = """
import signal
from islands_service.liveness import StopRequest, stop_on_signals
made = 0
signal.setitimer(signal.ITIMER_REAL, 0.5, 2e-4)
for _ in range(20_000):
    stopping = StopRequest()
    stop_on_signals(stopping)
    signal.signal(signal.SIGALRM, signal.getsignal(signal.SIGTERM))
    made += stopping.wait(1e-5)
signal.setitimer(signal.ITIMER_REAL, 0.0)
print(made)
"""


@pytest.mark.ci
def test_signal_during_a_wait_does_not_deadlock_the_stop_request() -> None:
    command = [sys.executable, "-c", WAITING]
    said = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60)
    assert said.stderr == ""
    assert int(said.stdout) > 1000


def test_stop_request_ends_the_wait_at_once_and_persists() -> None:
    stopping = StopRequest()
    assert not stopping.wait(0.0)
    assert not stopping.requested
    thread = Thread(target=lambda: (time.sleep(0.1), stopping.request()))
    began = time.monotonic()
    thread.start()
    assert stopping.wait(20.0)
    assert time.monotonic() - began < 19.0
    thread.join()
    assert stopping.requested
    assert stopping.wait(20.0)
    assert time.monotonic() - began < 19.0
