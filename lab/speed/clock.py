"""Clocks of the benchmark: the only module of the core that reads the time."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from islands.errors import SettingsError

#: Minimum CPU time of one measurement in milliseconds: far longer than the call of the clock.
_MIN_MS = 4.0


def cpu() -> float:
    """Return the CPU time of this process in seconds, including all its threads."""
    return time.process_time()


def wall() -> float:
    """Return the wall-clock time in seconds since an arbitrary moment."""
    return time.perf_counter()


def milliseconds(call: Callable[[], Any]) -> float:
    """Return the CPU time of one call in milliseconds, with warm caches; short calls are repeated.

    The first call is not measured: in a search the data are in the caches and the kernels are compiled.
    """
    call()
    calls, began = 0, cpu()
    while True:
        call()
        calls += 1
        spent = 1e3 * (cpu() - began)
        if spent >= _MIN_MS:
            return spent / calls


def refuse_threads() -> None:
    """Refuse to measure if the linear algebra library uses several threads.

    Their waiting would count as CPU time of plain numpy and make the kernels look faster.

    Raises
    ------
    SettingsError
        If the library uses several threads.
    """
    matrix = np.ones((600, 600))
    own, every = -time.thread_time(), -time.process_time()
    for _ in range(10):
        matrix @ matrix
    own, every = own + time.thread_time(), every + time.process_time()
    if every > 1.3 * own:
        raise SettingsError(
            "the linear algebra library uses several threads, so the times would not be comparable: set "
            "OPENBLAS_NUM_THREADS=1, OMP_NUM_THREADS=1 and MKL_NUM_THREADS=1 before Python starts"
        )
