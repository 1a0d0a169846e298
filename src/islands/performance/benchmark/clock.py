"""Clocks. Time is what a benchmark is about, so here alone the core reads one."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from islands.errors import SettingsError

#: Milliseconds of CPU time that one measurement takes at least: far more than the clock's own call.
_LEAST = 4.0


def cpu() -> float:
    """Return the CPU time of this process in seconds, all its threads together."""
    return time.process_time()


def wall() -> float:
    """Return the time on the wall in seconds, from an arbitrary moment."""
    return time.perf_counter()


def milliseconds(call: Callable[[], Any]) -> float:
    """Return the CPU time of one call: repeated where it is short, and with warm caches.

    The first call is not measured: a search has its data in the caches, and compiled what it runs.
    """
    call()
    calls, began = 0, cpu()
    while True:
        call()
        calls += 1
        spent = 1e3 * (cpu() - began)
        if spent >= _LEAST:
            return spent / calls


def refuse_threads() -> None:
    """Refuse to measure where the linear algebra runs in several threads.

    Their waiting would be counted as CPU time of plain numpy, and flatter us.

    Raises
    ------
    SettingsError
        It does.
    """
    matrix = np.ones((600, 600))
    own, every = -time.thread_time(), -time.process_time()
    for _ in range(10):
        matrix @ matrix
    own, every = own + time.thread_time(), every + time.process_time()
    if every > 1.3 * own:
        raise SettingsError(
            "the linear algebra library runs in several threads and the times would not compare: set "
            "OPENBLAS_NUM_THREADS=1, OMP_NUM_THREADS=1 and MKL_NUM_THREADS=1 before Python starts"
        )
