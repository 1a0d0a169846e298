"""Settings of this process: threads of numerical libraries, garbage collection, open files."""

import gc
import os
import resource
from contextlib import suppress
from functools import cache

#: Environment variables that set the number of threads of numerical libraries.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

#: Arguments of `gc.set_threshold`: allocations per collection of generation 0, collections per older one.
_GC_THRESHOLDS = 10_000, 20, 20

#: Upper bound on the limit of open files. Each connection takes one.
_MAX_OPEN_FILES = 65_536


def limit_threads() -> None:
    """Let numerical libraries use one thread, unless the environment says otherwise.

    Call it before NumPy is imported. The matrices are small, and the cores are busy with islands and jobs:
    more threads would wait for each other. Sums of floating-point numbers, and with them results, would
    depend on their number.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")


@cache
def freeze_garbage_collector() -> None:
    """Exclude all present objects of this process from garbage collection, and collect less often.

    Call it after the imports; later calls have no effect. A full collection visits every object that the
    imported packages have made, hundreds of thousands. It takes a quarter of the CPU of a search (decision
    0007), and delays every request of a web server by some hundredths of a second. Results do not depend on
    it.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_GC_THRESHOLDS)


def raise_file_limit() -> None:
    """Raise the soft limit of open files to the hard limit; the default is about a thousand."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    limit = _MAX_OPEN_FILES if hard == resource.RLIM_INFINITY else min(hard, _MAX_OPEN_FILES)
    if soft != resource.RLIM_INFINITY and soft < limit:
        # Some systems enforce a lower limit than the hard limit that they report.
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))
