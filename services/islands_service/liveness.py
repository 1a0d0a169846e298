"""The lifeline between the supervisor and a child: the child says that it lives, and ends when told to."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from threading import Event, Thread

#: Seconds between two signs of life.
EVERY = 0.5


def send_heartbeat(descriptor: int | None) -> None:
    """Tell the supervisor that this process lives; without a descriptor there is none to tell."""
    if descriptor is not None:
        # A pipe that is full has been told often enough; a supervisor that is gone has taken us with it.
        with suppress(BlockingIOError, BrokenPipeError):
            os.write(descriptor, b".")


@contextmanager
def watch_supervisor(descriptor: int | None) -> Iterator[None]:
    """Give signs of life from a thread of its own, as long as the block lasts."""
    over = Event()

    def beat() -> None:
        send_heartbeat(descriptor)
        while not over.wait(EVERY):
            send_heartbeat(descriptor)

    thread = Thread(target=beat, name="lifeline", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


class StopRequest:
    """The wish to stop: signal handlers and threads make it, the main thread waits for it.

    Not an `Event`: what sets one in a signal handler waits for ever where the signal has interrupted `wait`,
    which holds the lock. A queue's ``put`` may interrupt its own ``get``.
    """

    def __init__(self) -> None:
        self._requested = False
        self._bell: SimpleQueue[None] = SimpleQueue()

    def request(self) -> None:
        """Make the wish; again and at any moment, also from a signal handler."""
        self._requested = True
        self._bell.put(None)

    @property
    def requested(self) -> bool:
        """Whether it has been made: it is not taken back."""
        return self._requested

    def wait(self, seconds: float) -> bool:
        """Wait until it is made, or for so long; whether it is."""
        if not self._requested:
            with suppress(Empty):
                self._bell.get(timeout=seconds)
        return self._requested


def stop_on_signals(stopping: StopRequest) -> None:
    """Turn SIGTERM and Ctrl-C into a wish to stop. Ray takes SIGTERM for itself: call it again after Ray."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopping.request())
