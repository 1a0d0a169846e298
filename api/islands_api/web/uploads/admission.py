"""Admission of uploads before their body is read: uploads at once, and the owner's quota of stored bytes."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from islands_api.web.limits.owner_counts import OwnerCounts
from islands_api.web.problems import UploadLimitError
from islands_service.domain.job import QuotaError

#: Value of the header Retry-After in seconds if too many uploads are in progress.
_RETRY_AFTER = 5.0


class UploadAdmission:
    """Counts the uploads of every owner that are in progress, and the bytes that they may store.

    Parameters
    ----------
    total : int
        Maximum number of uploads in progress.
    """

    def __init__(self, total: int) -> None:
        self._total = total
        self._uploads = OwnerCounts("uploads", _refuse)
        self._reserved: Counter[str] = Counter()

    @contextmanager
    def admit(self, owner: str, most: int) -> Iterator[None]:
        """Count an upload during the block. The owner may have ``most`` in progress.

        Raises
        ------
        UploadLimitError
            Too many uploads are in progress.
        """
        with self._uploads.count(owner, most):
            if self._uploads.total > self._total:
                raise _refuse(f"{self._total} uploads are in progress, the most of this service: try again")
            yield

    @contextmanager
    def reserve(self, owner: str, least: int, most: int, stored: int, max_stored: int) -> Iterator[int]:
        """Reserve bytes of the owner's quota during the block; yield their number.

        Parameters
        ----------
        least, most : int
            Bytes that the upload needs, and that it may have. They differ if its size is not declared.
        stored, max_stored : int
            Bytes that the owner has stored, and may store.

        Raises
        ------
        QuotaError
            The owner has fewer than ``least`` bytes left.
        """
        left = max_stored - stored - self._reserved[owner]
        if left < least:
            raise QuotaError(
                f"the data sets take {stored / 1e6:.1f} MB, uploads in progress "
                f"{self._reserved[owner] / 1e6:.1f} MB, this one has {least / 1e6:.1f} MB, and "
                f"{max_stored / 1e6:.1f} MB is the most: delete some"
            )
        reserved = min(most, left)
        self._reserved[owner] += reserved
        try:
            yield reserved
        finally:
            self._reserved[owner] -= reserved
            self._reserved += Counter()


def _refuse(message: str) -> UploadLimitError:
    return UploadLimitError(message, _RETRY_AFTER)
