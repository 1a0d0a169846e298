"""Supervisor and child processes: heartbeat pipe, exit statuses, and cooperative shutdown."""

import ctypes
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from threading import Event, Thread

#: Seconds between two heartbeats.
EVERY = 0.5

#: Heartbeat of a process, of one that uses the roles which it may need, and of one that starts its program
#: again.
ALIVE, IN_NEED, STARTING = b".", b"n", b"s"

#: Exit status after an error that only its message describes.
FAILED = 1

#: Exit status of a child that cannot run with these settings. It is not restarted, unless it has run with
#: them before.
MISCONFIGURED = 2

#: Exit status of a child that waits for something outside, such as the database. It is started again as long
#: as that takes.
UNAVAILABLE = os.EX_TEMPFAIL

#: Option of Linux's prctl: the signal that a process receives when its parent ends.
_PR_SET_PDEATHSIG = 1


def set_parent_death_signal(number: signal.Signals) -> None:
    """Let this process receive a signal when its parent ends, as far as the system supports it."""
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number)


def send_heartbeat(descriptor: int | None, message: bytes = ALIVE) -> None:
    """Write a heartbeat to the pipe of the supervisor. Do nothing without a descriptor."""
    if descriptor is not None:
        # A full pipe holds enough heartbeats. A broken pipe means that the supervisor has exited.
        with suppress(BlockingIOError, BrokenPipeError):
            os.write(descriptor, message)


class Heartbeats:
    """Heartbeats of this process to its supervisor.

    Parameters
    ----------
    descriptor : int or None
        The pipe of the supervisor; None without one.
    """

    def __init__(self, descriptor: int | None) -> None:
        self._descriptor, self._message = descriptor, ALIVE

    def send(self) -> None:
        """Send a heartbeat."""
        send_heartbeat(self._descriptor, self._message)

    def demand_roles(self) -> None:
        """Ask the supervisor to run the roles that this one may need, as long as this process runs."""
        self._message = IN_NEED
        self.send()


@contextmanager
def watch_supervisor(descriptor: int | None) -> Iterator[Heartbeats]:
    """Send heartbeats from a background thread while the block runs."""
    over, heartbeats = Event(), Heartbeats(descriptor)

    def beat() -> None:
        heartbeats.send()
        while not over.wait(EVERY):
            heartbeats.send()

    thread = Thread(target=beat, name="heartbeat pipe", daemon=True)
    thread.start()
    try:
        yield heartbeats
    finally:
        over.set()
        thread.join()


class StopRequest:
    """Stop request, set by signal handlers and threads, awaited by the main thread.

    An `Event` would deadlock: `Event.set` in a signal handler waits for the lock that the interrupted
    `Event.wait` holds. `SimpleQueue.put` is reentrant and may interrupt `get`.
    """

    def __init__(self) -> None:
        self._requested = False
        self._bell: SimpleQueue[None] = SimpleQueue()

    def request(self) -> None:
        """Request the stop. Safe to call repeatedly and from a signal handler."""
        self._requested = True
        self._bell.put(None)

    def wake(self) -> None:
        """End a wait before its time. Safe to call from a signal handler."""
        self._bell.put(None)

    @property
    def requested(self) -> bool:
        """Whether a stop was requested. A request cannot be withdrawn."""
        return self._requested

    def wait(self, seconds: float) -> bool:
        """Wait for the request or for `wake`, at most some seconds; return whether a stop was requested."""
        if not self._requested:
            with suppress(Empty):
                self._bell.get(timeout=seconds)
        return self._requested


def stop_on_signals(stopping: StopRequest) -> None:
    """Turn SIGTERM and Ctrl-C into a stop request. Repeat it after `ray.init`, which replaces handlers."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopping.request())
