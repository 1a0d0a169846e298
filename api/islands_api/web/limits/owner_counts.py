"""Counts of something that is in progress, by owner."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from islands_service.domain.job import QuotaError


class OwnerCounts:
    """Counts what every owner has in progress, and refuses more than its quota.

    Parameters
    ----------
    what : str
        Plural noun for messages.
    refuse : callable
        Makes the error of a quota that is used up from its message.
    """

    def __init__(self, what: str, refuse: Callable[[str], Exception] = QuotaError) -> None:
        self._what, self._refuse = what, refuse
        self._counts: Counter[str] = Counter()

    @property
    def total(self) -> int:
        """Number in progress of all owners."""
        return self._counts.total()

    @contextmanager
    def count(self, owner: str, most: int) -> Iterator[None]:
        """Count one more during the block.

        Raises
        ------
        QuotaError
            The owner has ``most`` in progress. Another error if `refuse` makes one.
        """
        if self._counts[owner] >= most:
            raise self._refuse(
                f"{self._counts[owner]} {self._what} of this owner are in progress, and {most} is the most: "
                "wait until one has ended"
            )
        self._counts[owner] += 1
        try:
            yield
        finally:
            self._counts[owner] -= 1
            self._counts += Counter()  # drops owners without any
