"""Turn of a job: how long it runs while other owners wait."""

from collections.abc import Callable
from time import monotonic

from islands.errors import IslandsError


class TurnOver(IslandsError):  # noqa: N818 - control flow, not an error
    """Another owner waits that has a smaller share of the coordinators."""


class Turn:
    """Turn of a job in this process.

    It begins with the first checkpoint, so that the start of actors on a busy machine takes none of it, and
    ends with a checkpoint, so that each turn makes progress.

    Parameters
    ----------
    seconds : float
        Least duration.
    do_others_wait : callable
        Returns whether another owner waits that has a smaller share.
    """

    def __init__(self, seconds: float, do_others_wait: Callable[[], bool]) -> None:
        self._seconds, self._do_others_wait = seconds, do_others_wait
        self._until: float | None = None

    def end_if_over(self) -> None:
        """End the turn after a checkpoint if it is over and another owner waits.

        Raises
        ------
        TurnOver
        """
        now = monotonic()
        if self._until is None:
            self._until = now + self._seconds
        elif now > self._until and self._do_others_wait():
            raise TurnOver("the turn of the job is over, and a job of another owner waits")
