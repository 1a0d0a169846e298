"""Progress callbacks: how a long computation reports what it does."""

from typing import Protocol


class ProgressCallback(Protocol):
    """Takes reports of a long computation. It never influences the result."""

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        """Take a report.

        Parameters
        ----------
        message : str
            Current step, for a reader.
        fraction : float or None
            Completed part of the computation, from 0 to 1; None if unknown.
        """


def ignore_progress(_message: str, _fraction: float | None = None, /) -> None:
    """Ignore reports."""
