"""Progress callbacks of long computations."""

from typing import Protocol


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
