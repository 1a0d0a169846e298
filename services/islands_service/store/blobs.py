"""Content-addressed files: uploaded records, checkpoints, reports and figures."""

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from errno import EACCES, EDQUOT, EIO, ENODEV, ENOENT, ENOSPC, EPERM, EROFS, ESTALE
from pathlib import Path
from time import monotonic
from typing import IO

from islands.errors import IslandsError
from islands_service.store.database import StorageFullError, StoreUnavailableError, ignore_duration

#: Suffix of a file that is being written.
PART = ".part"


class BlobNotFoundError(IslandsError):
    """A stored file is missing from the data folder: the operator must restore it from a backup."""


class DataFolderUnavailableError(StoreUnavailableError):
    """The data folder cannot be written now. Nothing was written; try again."""


#: Errors of a folder that is read-only, unmounted or unreachable, until the operator repairs it.
_FOLDER_ERRORS = (EROFS, EIO, ESTALE, ENODEV, ENOENT, EACCES, EPERM)


class Blobs:
    """Folder of blobs. A blob is immutable: its name is the SHA-256 of its bytes.

    Parameters
    ----------
    folder : Path
        Created if it does not exist. All roles of a cluster must share it, or use an object store:
        `islands_service.store.cached_blobs`.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        #: Called with the seconds until a blob was on the disk.
        self.observe_write: Callable[[float], None] = ignore_duration
        #: Called with the name, the outcome and the seconds of each operation of an object store.
        self.observe_object: Callable[[str, str, float], None] = _ignore_operation
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)

    @contextmanager
    def hold(self, blob: str) -> Iterator[Path]:
        """Provide a blob as a file that stays until the end of the block.

        Raises
        ------
        BlobNotFoundError
        """
        yield self.path(blob)

    def path(self, blob: str) -> Path:
        """Return the path of a blob in the folder.

        Raises
        ------
        BlobNotFoundError
        """
        path = self._at(blob)
        if not path.is_file():
            raise self._not_found(blob)
        return path

    def open(self, blob: str) -> IO[bytes]:
        """Open a blob for reading. An open blob can be read even if it is deleted meanwhile.

        Raises
        ------
        BlobNotFoundError
        """
        try:
            return self._at(blob).open("rb")
        except FileNotFoundError as error:
            raise self._not_found(blob) from error

    def read(self, blob: str) -> bytes:
        """Return the bytes of a blob.

        Raises
        ------
        BlobNotFoundError
        """
        with self.open(blob) as stream:
            return stream.read()

    def write(self, data: bytes) -> str:
        """Store bytes; return their blob once it is on the disk.

        Raises
        ------
        StorageFullError, DataFolderUnavailableError
        """
        with self.receiving() as stream:
            stream.write(data)
            return self.keep(stream)

    @contextmanager
    def receiving(self) -> Iterator[IO[bytes]]:
        """Open a temporary file for incoming bytes. It is deleted after the block unless it was kept.

        Raises
        ------
        StorageFullError, DataFolderUnavailableError
        """
        with (
            translate_folder_errors(),
            tempfile.NamedTemporaryFile(dir=self._folder, suffix=PART, delete=False) as stream,
        ):
            try:
                yield stream
            finally:
                with suppress(FileNotFoundError):
                    Path(stream.name).unlink()

    def spool(self) -> IO[bytes]:
        """Open a nameless file for bytes of a request, which vanishes when it is closed or the process ends.

        Raises
        ------
        StorageFullError, DataFolderUnavailableError
        """
        with translate_folder_errors():
            return tempfile.TemporaryFile(dir=self._folder)

    def keep(self, stream: IO[bytes]) -> str:
        """Store a file that has received all its bytes as a blob.

        Raises
        ------
        StorageFullError, DataFolderUnavailableError
        """
        began = monotonic()
        with translate_folder_errors():
            stream.flush()
            blob = hash_file(Path(stream.name))
            self._place(stream, blob)
        self.observe_write(monotonic() - began)
        return blob

    def _place(self, stream: IO[bytes], blob: str) -> None:
        """Give a temporary file its final name once it is on the disk."""
        with Path(stream.name).open("rb") as written:
            os.fsync(written.fileno())
        path = self._at(blob)
        path.parent.mkdir(exist_ok=True, mode=0o700)
        try:
            known = path.stat().st_size == Path(stream.name).stat().st_size
            if known:
                # A confined process that is about to open this file may not open another one in its place.
                os.utime(path)
        except FileNotFoundError:
            known = False
        if not known:
            Path(stream.name).replace(path)
        for folder in (path.parent, self._folder):
            _sync(folder)

    def check_writable(self) -> None:
        """Write a temporary file.

        Raises
        ------
        StorageFullError, DataFolderUnavailableError
        """
        with self.receiving() as stream:
            stream.write(bytes(4096))
            stream.flush()

    def check_settings(self) -> None:
        """Refuse settings with which blobs cannot be stored: a folder has none."""

    def all(self) -> Iterator[tuple[str, Path]]:
        """Yield every blob in the folder with its path; partly written files have an empty name."""
        for path in self._folder.glob(f"*{PART}"):
            yield "", path
        for path in self._folder.glob("??/*"):
            yield path.name, path

    def sweep(self, named: Iterable[str], before: float) -> int:
        """Remove unreferenced blobs written before a time in seconds since 1970; return their number.

        Younger blobs are kept, since a reference to them may be about to be written.
        """
        needed, removed = set(named), 0
        for blob, path in self.all():
            with suppress(FileNotFoundError):
                if blob not in needed and path.stat().st_mtime < before:
                    path.unlink()
                    removed += 1
        return removed

    def discard(self, blob: str) -> None:
        """Remove a blob that no row references and no process is about to write; it may be missing."""
        # A file that cannot be removed now is removed by a sweep.
        with suppress(OSError):
            self._at(blob).unlink()

    def _not_found(self, blob: str) -> BlobNotFoundError:
        return BlobNotFoundError(
            f"the blob {blob} is not in {self._folder}: restore the data folder from a backup"
        )

    def _at(self, blob: str) -> Path:
        return self._folder / blob[:2] / blob


@contextmanager
def translate_disk_full() -> Iterator[None]:
    """Translate the error of a full disk to `StorageFullError`.

    Raises
    ------
    StorageFullError
    """
    try:
        yield
    except OSError as error:
        if error.errno not in (ENOSPC, EDQUOT):
            raise
        raise StorageFullError(
            f"the disk of the data folder is full ({error.strerror}): make room"
        ) from error


def _ignore_operation(name: str, outcome: str, seconds: float) -> None:
    """Ignore an operation of an object store."""


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@contextmanager
def translate_folder_errors() -> Iterator[None]:
    """Translate the errors of a folder that is full or cannot be written."""
    with translate_disk_full():
        try:
            yield
        except OSError as error:
            if error.errno not in _FOLDER_ERRORS:
                raise
            raise DataFolderUnavailableError(
                f"the data folder cannot be written ({error.strerror}): nothing was written; try again"
            ) from error


def _sync(folder: Path) -> None:
    """Flush the entries of a folder to the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
