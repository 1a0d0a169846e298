"""Pool of processes on this computer, and the signals that its processes do not receive."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import lru_cache, partial
from multiprocessing import active_children, forkserver, get_context, parent_process, resource_tracker
from os import kill
from signal import SIG_BLOCK, SIG_IGN, SIG_SETMASK, SIGINT, SIGKILL, pthread_sigmask, raise_signal, signal
from threading import Thread
from time import monotonic
from typing import Any, TypeVar

import cloudpickle

from islands.available_cpus import count_cpus
from islands.errors import IslandsError, name_without_value
from islands.parallel import ParallelMap

#: Seconds of a computation before the first process is used. Shorter ones need none.
START_AFTER = 1.0

#: Seconds between two checks.
_CHECK_SECONDS = 0.1

#: Modules that are imported once, in the process from which the others are forked.
_PRELOADED = [
    "__main__",
    "islands.diagnosis.procedure",
    "islands.simulators.specification.factory",
    "islands.report.figures.diagnosis",
]

A = TypeVar("A")
R = TypeVar("R")


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


class ProcessPoolError(IslandsError):
    """A process has ended during a computation."""


@contextmanager
def process_pool(
    workers: int | None = None,
    start_after: float = START_AFTER,
    check: Callable[[], object] = lambda: None,
) -> Iterator[ParallelMap]:
    """Provide a parallel map on processes of this computer while the block runs.

    Functions and arguments may be of any type, with functions that are defined in functions.

    Parameters
    ----------
    workers : int or None
        Largest number of processes; None for one per core. One computes in this process.
    start_after : float
        Seconds for which calls are evaluated in this process, one after the other.
    check : callable
        Called before each evaluation in this process, and many times a second while others evaluate. It may
        raise an error.

    Raises
    ------
    ProcessPoolError
        A process has ended. Errors of the function itself are raised unchanged.
    """
    workers = workers or count_cpus()
    if workers == 1:
        yield partial(_map_here, check)
        return
    began, others = monotonic(), set(active_children())
    context = get_context("forkserver")
    context.set_forkserver_preload(_PRELOADED)
    # It imports while this process computes. Ctrl-C in a terminal would end these imports with a traceback:
    # it starts with the signal blocked.
    with block_sigint():
        forkserver.ensure_running()
    pool = ProcessPoolExecutor(workers, context, initializer=prepare_process)

    def parallel_map(function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
        waiting = iter(arguments)
        for argument in waiting:
            if monotonic() - began > start_after:
                yield from _map_on(pool, function, [argument, *waiting], check)
                return
            check()
            yield function(argument)

    try:
        yield parallel_map
    except BaseException:
        _end_server()
        raise
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(active_children()) - others:
            process.kill()  # its result is not needed any more


def prepare_process() -> None:
    """Let this process ignore Ctrl-C, and end with the process that has started it.

    Otherwise it would wait for calls for ever after that process is killed, and so would the fork server.
    """
    signal(SIGINT, SIG_IGN)

    def wait() -> None:
        if parent := parent_process():
            parent.join()
            raise_signal(SIGKILL)

    Thread(target=wait, daemon=True).start()


def _end_server() -> None:
    """End the fork server, which would keep the standard output open until it has imported everything.

    The next pool starts another one.
    """
    # `multiprocessing` has no public names for this process and its end.
    server: Any = forkserver._forkserver
    if server._forkserver_pid is not None:
        kill(server._forkserver_pid, SIGKILL)
        server._stop()


def _map_here(
    check: Callable[[], object], function: Callable[[A], R], arguments: Iterable[A], /
) -> Iterator[R]:
    for argument in arguments:
        check()
        yield function(argument)


def _map_on(
    pool: ProcessPoolExecutor,
    function: Callable[[A], R],
    arguments: Iterable[A],
    check: Callable[[], object],
) -> Iterator[R]:
    call: Any = partial(_call, cloudpickle.dumps(function))
    try:
        for result in [pool.submit(call, cloudpickle.dumps(argument)) for argument in arguments]:
            check()
            while not wait([result], _CHECK_SECONDS).done:
                check()
            yield cloudpickle.loads(result.result())
    except BrokenProcessPool as error:
        raise ProcessPoolError(
            "a process has ended, perhaps because memory was full: repeat it with fewer "
            f"{name_without_value('workers')}"
        ) from error


def _call(function: bytes, argument: bytes) -> bytes:
    # Results may have effects, which contain functions without a name.
    result: bytes = cloudpickle.dumps(_load(function)(cloudpickle.loads(argument)))
    return result


@lru_cache(maxsize=1)
def _load(function: bytes) -> Any:
    return cloudpickle.loads(function)
