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
    """A computation was stopped.

    Attributes
    ----------
    step : str
        Step that was left out.
    """

    def __init__(self, step: str) -> None:
        super().__init__(f"stopped before this step: {step}")
        self.step = step


class Steps:
    """Steps of a long computation, which a stop request ends between two of them.

    A computation calls this object at the start of every step without which it has no result, and `skip` at
    the start of every other step.

    Parameters
    ----------
    progress : ProgressCallback
    stop : callable
        Returns true once a stop is requested, and from then on.
    """

    def __init__(self, progress: ProgressCallback = ignore_progress, stop: Stop = never_stop) -> None:
        self.report, self.stop = progress, stop
        self._left_out: dict[str, None] = {}

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        """Report a step that the result needs.

        Raises
        ------
        StoppedError
            A stop is requested.
        """
        self.check(message)
        self.report(message, fraction)

    def check(self, step: str) -> None:
        """Raise `StoppedError` if a stop is requested within a step that the result needs."""
        if self.stop():
            raise StoppedError(step)

    def skip(self, step: str) -> bool:
        """Return whether a step must be left out because a stop is requested, and record its name."""
        if not self.stop():
            return False
        self._left_out[step] = None
        return True

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of the steps that were left out, each once, in their order."""
        return tuple(self._left_out)
