"""Requests to stop a long command: Ctrl-C, and SIGTERM for a search."""

import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import typer

from islands_api.cli.console import errors

#: Exit code after Ctrl-C.
INTERRUPTED = 130


class StopRequests:
    """Whether a signal has requested a stop. Calling it returns whether one has."""

    def __init__(self) -> None:
        self.number: int | None = None

    def __call__(self) -> bool:
        """Return whether a stop is requested."""
        return self.number is not None

    def receive(self, number: int, _frame: object) -> None:
        """Handle a signal. A second Ctrl-C raises `KeyboardInterrupt`."""
        if self() and number == signal.SIGINT:
            raise KeyboardInterrupt
        self.number = number

    def explain(self, folder: Path, next_step: str) -> None:
        """Say what a stopped result lacks."""
        errors.print(
            f"stopped: {folder} has the best models so far, without the steps that were left out: "
            f"refinement, prediction bands or figures; {next_step}",
            markup=False,
        )

    def exit(self) -> None:
        """End the command with exit code 130 if Ctrl-C has stopped it."""
        if self.number == signal.SIGINT:
            raise typer.Exit(INTERRUPTED)


@contextmanager
def stop_requests(
    signals: Sequence[signal.Signals] = (signal.SIGINT, signal.SIGTERM),
) -> Iterator[StopRequests]:
    """Yield the stop requests by signals that arrive while the block runs."""
    requests = StopRequests()
    before = {number: signal.signal(number, requests.receive) for number in signals}
    try:
        yield requests
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
