"""Requests to stop a command: Ctrl-C and SIGTERM.

A step with results so far polls the requests of `stop_requests` and keeps its results. Everywhere else a
signal ends the command at once, as an exception.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import typer

from islands.cli.console import errors
from islands.progress import StoppedError

#: How to get the complete result of a command that cannot be resumed.
REPEAT = "repeat the command with --force for the complete result"

#: Exit codes after Ctrl-C, and after SIGTERM without a result: 128 and the number of the signal.
INTERRUPTED, TERMINATED = 130, 143


class Terminated(KeyboardInterrupt):
    """SIGTERM has arrived."""


_SIGNALS = (signal.SIGINT, signal.SIGTERM)

#: Signals that have raised an exception. Python ignores one that is raised in a callback of an import.
_raised: list[int] = []


@contextmanager
def raise_on_signals() -> Iterator[None]:
    """Let SIGTERM raise `Terminated` and SIGINT `KeyboardInterrupt` while the block runs.

    A signal that the parent process has set to be ignored is ignored.
    """

    def receive(number: int, _frame: object) -> NoReturn:
        _raised.append(number)
        raise Terminated if number == signal.SIGTERM else KeyboardInterrupt

    with _handle(receive, [each for each in _SIGNALS if signal.getsignal(each) != signal.SIG_IGN]):
        try:
            yield
        finally:
            _raised.clear()


@contextmanager
def _handle(receive: Callable[[int, Any], None], signals: Iterable[signal.Signals]) -> Iterator[None]:
    """Handle signals by a function while the block runs."""
    before = {number: signal.signal(number, receive) for number in signals}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def ignore_signals() -> None:
    """Ignore signals from now on: the command has ended, and its result and exit code are known."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def end_at_once(interrupt: KeyboardInterrupt) -> NoReturn:
    """End this process although another of its threads is in a library that does not return."""
    errors.print("stopped")
    sys.stdout.flush()
    os._exit(exit_code(interrupt))


def exit_code(interrupt: KeyboardInterrupt) -> int:
    """Return the exit code of a command that a signal has ended without a result."""
    return TERMINATED if isinstance(interrupt, Terminated) else INTERRUPTED


class StopRequests:
    """Whether a signal has requested a stop. Calling it returns whether one has.

    Parameters
    ----------
    interrupt : KeyboardInterrupt, optional
        Exception of a signal that has ended the step before.
    """

    def __init__(self, interrupt: KeyboardInterrupt | None = None) -> None:
        self.number: int | None = _raised[-1] if _raised else None
        if interrupt is not None:
            self.number = signal.SIGTERM if isinstance(interrupt, Terminated) else signal.SIGINT

    def __call__(self) -> bool:
        """Return whether a stop is requested."""
        return self.number is not None

    def receive(self, number: int, _frame: object) -> None:
        """Handle a signal. A second Ctrl-C raises `KeyboardInterrupt`."""
        if self() and number == signal.SIGINT:
            raise KeyboardInterrupt
        self.number = number

    def end(self, folder: Path | None, left_out: Sequence[str], next_step: str) -> None:
        """Say what a stopped result lacks, and end the command; return if no stop is requested.

        Parameters
        ----------
        folder : Path or None
            Folder or file with the result; None if it was printed only.
        left_out : sequence of str
            Steps that were left out.
        next_step : str
            How to get the complete result.
        """
        if not self():
            return
        kept = "the result so far is above" if folder is None else f"{folder} has the result so far"
        steps = f", without {', '.join(left_out)}" if left_out else ", which is complete"
        advice = f"; {next_step}" if left_out else ""
        errors.print(f"stopped: {kept}{steps}{advice}", markup=False)
        raise typer.Exit(INTERRUPTED if self.number == signal.SIGINT else 0)


@contextmanager
def stop_requests(before_block: StopRequests | None = None) -> Iterator[StopRequests]:
    """Yield the stop requests by signals that arrive while the block runs.

    If the block raises `StoppedError`, there is no result, and the command ends.

    Parameters
    ----------
    before_block : StopRequests, optional
        Requests of an earlier block, which hold for this one as well.
    """
    requests = before_block or StopRequests()
    try:
        with _handle(requests.receive, _SIGNALS):
            yield requests
    except StoppedError as stopped:
        if not requests():
            raise
        errors.print(f"{stopped}; there is no result to keep", markup=False)
        code = INTERRUPTED if requests.number == signal.SIGINT else TERMINATED
        raise typer.Exit(code) from stopped
