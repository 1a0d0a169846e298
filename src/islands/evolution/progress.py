"""Progress callbacks of long computations, and requests to stop them."""

from collections.abc import Callable
from typing import Protocol

from islands.errors import IslandsError

#: Returns true if the computation must end.
Stop = Callable[[], bool]


class ProgressCallback(Protocol):
    """Callback for the progress of a long computation. It never influences the result."""

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        """Report progress.

        Parameters
        ----------
        message : str
            Description of the current step.
        fraction : float or None
            Completed part of the computation, from 0 to 1; None if unknown.
        """


def ignore_progress(_message: str, _fraction: float | None = None, /) -> None:
    """Ignore progress."""


def never_stop() -> bool:
    """Return that the computation may continue."""
    return False


class StoppedError(IslandsError):
    """A computation was stopped before it had its result."""

    def __init__(self, step: str) -> None:
        super().__init__(f"stopped before the first models were found ({step}): there is no model to keep")
        self.step = step


def stop_between_steps(progress: ProgressCallback, stop: Stop) -> ProgressCallback:
    """Return a progress callback that raises `StoppedError` once a stop is requested.

    Long computations report progress at the start of every step. Those with results so far catch the error
    and return them.
    """

    def report(message: str, fraction: float | None = None, /) -> None:
        if stop():
            raise StoppedError(message)
        progress(message, fraction)

    return report
