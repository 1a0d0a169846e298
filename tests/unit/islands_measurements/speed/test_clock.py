"""Clocks, and the refusal of a multithreaded linear algebra library."""

import multiprocessing
import os
import subprocess
import sys
import time

import pytest

from islands_measurements.speed.clock import cpu, milliseconds, wall

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def busy(seconds):
    began = time.process_time()
    while time.process_time() - began < seconds:
        pass


@pytest.mark.parametrize("seconds", [0.0005, 0.01])
def test_milliseconds_returns_the_time_of_one_call(seconds):
    assert milliseconds(lambda: busy(seconds)) == pytest.approx(1e3 * seconds, rel=0.5)


def test_first_call_is_not_measured():
    waits = [0.2]
    calls = []

    def call():
        calls.append(None)
        busy(waits.pop() if waits else 0.001)

    assert milliseconds(call) < 20.0
    assert len(calls) >= 4


def test_waiting_takes_only_wall_clock_time():
    began_cpu, began = cpu(), wall()
    time.sleep(0.05)
    assert wall() - began >= 0.05
    assert cpu() - began_cpu < 0.04


def refused(threads):
    code = "from islands_measurements.speed.clock import refuse_threads; refuse_threads()"
    environment = os.environ | dict.fromkeys(THREADS, str(threads))
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 or "OPENBLAS_NUM_THREADS=1" in done.stderr, done.stderr
    return done.returncode != 0


def test_one_thread_is_accepted():
    assert not refused(1)


@pytest.mark.ci
@pytest.mark.skipif(multiprocessing.cpu_count() < 2, reason="one core has no use for two threads")
def test_two_threads_are_refused():
    assert refused(2)
