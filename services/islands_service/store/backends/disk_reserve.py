"""Reserve of disk space for an embedded database, so that what fills a disk can be deleted.

A deletion writes, too: without room even the client that wants to free some could not.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from sqlalchemy import make_url

#: Bytes of the reserve, and its largest share of the disk.
_BYTES, _SHARE = 8_000_000, 0.05


class DiskReserve:
    """File that takes disk space until an operation needs it.

    Parameters
    ----------
    url : str
        URL of the database. One that is not a file on this machine has no reserve.
    """

    def __init__(self, url: str) -> None:
        name = make_url(url).database if url.startswith("sqlite") else None
        self._path = None if name is None else Path(f"{name}-reserve")

    def fill(self) -> None:
        """Allocate the reserve unless that would take half of the space that is left."""
        if self._path is None:
            return
        with suppress(OSError), self._path.open("ab") as stream:
            disk = os.statvfs(stream.fileno())
            size = min(_BYTES, int(_SHARE * disk.f_blocks * disk.f_frsize))
            if os.fstat(stream.fileno()).st_size < size and 2 * size < disk.f_bavail * disk.f_frsize:
                os.posix_fallocate(stream.fileno(), 0, size)

    @contextmanager
    def release(self) -> Iterator[None]:
        """Free the reserve during the block, and fill it again as far as there is room."""
        with suppress(OSError):
            if self._path is not None:
                os.truncate(self._path, 0)
        try:
            yield
        finally:
            self.fill()
