"""Counts of something that is in progress, by owner."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from islands_service.domain.job import QuotaError


class OwnerCounts:
    """Counts what every owner has in progress, and refuses more than its quota.

    Parameters
    ----------
    what : str
        Plural noun for messages.
    """

    def __init__(self, what: str) -> None:
        self._what = what
        self._counts: Counter[str] = Counter()

    @contextmanager
    def count(self, owner: str, most: int) -> Iterator[None]:
        """Count one more during the block.

        Raises
        ------
        QuotaError
            The owner has ``most`` in progress.
        """
        if self._counts[owner] >= most:
            raise QuotaError(
                f"{self._counts[owner]} {self._what} of this owner are in progress, and {most} is the most: "
                "wait until one has ended"
            )
        self._counts[owner] += 1
        try:
            yield
        finally:
            self._counts[owner] -= 1
            self._counts += Counter()  # drops owners without any
