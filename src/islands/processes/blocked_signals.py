"""Start of processes that Ctrl-C in a terminal does not reach; the process that starts them ends them."""

from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from signal import SIG_BLOCK, SIG_SETMASK, SIGINT, pthread_sigmask


@contextmanager
def block_sigint() -> Iterator[None]:
    """Block SIGINT in the processes that `multiprocessing` starts while the block runs.

    The signal would end their imports with a traceback.
    """
    # The start of the resource tracker, which the first process needs, unblocks signals.
    resource_tracker.ensure_running()
    unblocked = pthread_sigmask(SIG_BLOCK, {SIGINT})
    try:
        yield
    finally:
        pthread_sigmask(SIG_SETMASK, unblocked)
