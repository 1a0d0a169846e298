"""Blobs in an object store, with a cache of limited size in a folder."""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic, time
from typing import IO
from uuid import uuid4

import structlog

from islands.errors import SettingsError
from islands_service.settings import ServiceSettings
from islands_service.store.blobs import PART, BlobNotFoundError, Blobs, hash_file, translate_folder_errors
from islands_service.store.buckets import (
    ObjectNotFoundError,
    ObjectStore,
    ObjectStoreError,
    ObjectStoreRefusedError,
)

log = structlog.get_logger()

#: Share of the size of the cache that is left after files were removed to make room.
_LEFT_SHARE = 0.8

#: Seconds after which a file that was not completed, or is held by a process that has ended, is removed.
_PART_AGE = 3600.0

#: Least number of seconds between two sweeps of the object store by one process: each lists all objects.
SWEEP_SECONDS = 3600.0

#: Attempts at an object whose bytes do not have its hash.
_DOWNLOADS = 2

_KEY = re.compile(r"[0-9a-f]{2}/([0-9a-f]{64})")
_BINNED = re.compile(r"unnamed/([0-9a-f]{64})")


class CachedBlobs(Blobs):
    """Blobs in an object store. The folder is a cache, which several processes of a machine may share.

    A blob is in the object store before `keep` returns, so before a row can name it; every machine can read a
    blob that the database names. Each download is compared with the SHA-256. A blob is always uploaded, even
    if the store has it already: that repairs a damaged object, and lets `sweep` know that it is in use.

    `sweep` renames an unreferenced object, and deletes it in a later sweep unless a row names it by then. An
    object store cannot delete an object on condition that it was not stored again after the listing.

    Parameters
    ----------
    folder : Path
        Created if it does not exist.
    objects : ObjectStore
    most_bytes : int
        Size of the cache. Files that are being received or read are not counted.
    """

    def __init__(self, folder: Path, objects: ObjectStore, most_bytes: int) -> None:
        super().__init__(folder)
        self._objects, self._most_bytes = objects, most_bytes
        # Bytes that can be added before the files have to be counted again.
        self._room = 0
        self._sweep_at = 0.0
        objects.observe = self._observe_object

    @contextmanager
    def hold(self, blob: str) -> Iterator[Path]:
        """Provide a blob as a file that stays until the end of the block, whatever the cache drops.

        Raises
        ------
        BlobNotFoundError
            The object is missing or damaged.
        ObjectStoreError, StorageFullError
        """
        held = self._folder / f"{uuid4().hex}{PART}"
        try:
            with translate_folder_errors():
                self._fetch(blob, held)
            yield held
        finally:
            held.unlink(missing_ok=True)

    def open(self, blob: str) -> IO[bytes]:
        """Open a blob for reading. An open blob can be read even if it is deleted meanwhile.

        Raises
        ------
        BlobNotFoundError, ObjectStoreError, StorageFullError
        """
        with self.hold(blob) as path:
            return path.open("rb")

    def keep(self, stream: IO[bytes]) -> str:
        """Store a file that has received all its bytes as a blob.

        Raises
        ------
        ObjectStoreError, StorageFullError
        """
        began = monotonic()
        with translate_folder_errors():
            stream.flush()
            blob = hash_file(Path(stream.name))
            self._objects.put(_key(blob), Path(stream.name))
            self._place(stream, blob)
            self._make_room(self._at(blob))
        self.observe_write(monotonic() - began)
        return blob

    def check_writable(self) -> None:
        """Write a temporary file, and ask the object store.

        Raises
        ------
        ObjectStoreError, StorageFullError
        OSError
            The folder cannot be written.
        """
        super().check_writable()
        self._objects.check()

    def check_settings(self) -> None:
        """Refuse settings with which the object store refuses the service. It may be absent.

        Raises
        ------
        SettingsError
        """
        try:
            self._objects.check()
        except ObjectStoreRefusedError as error:
            raise SettingsError(str(error)) from error
        except ObjectStoreError as error:
            log.warning("object store unavailable", reason=str(error))

    def sweep(self, named: Iterable[str], before: float) -> int:
        """Remove unreferenced blobs written before a time in seconds since 1970; return their number.

        Raises
        ------
        ObjectStoreError
        """
        needed = frozenset(named)
        removed = super().sweep(needed, before)
        if monotonic() < self._sweep_at:
            return removed
        self._sweep_at = monotonic() + SWEEP_SECONDS
        for key, written in list(self._objects.all()):
            with suppress(ObjectNotFoundError):  # another coordinator sweeps
                removed += self._sweep_object(key, needed, written < before)
        return removed

    def _sweep_object(self, key: str, needed: frozenset[str], old: bool) -> bool:
        """Rename or delete an object that no row references; return whether it is deleted."""
        if (stored := _KEY.fullmatch(key)) and stored[1] not in needed and old:
            self._objects.move(key, _binned(stored[1]))
        elif (binned := _BINNED.fullmatch(key)) and binned[1] in needed:
            self._objects.move(key, _key(binned[1]))
        elif binned and old:
            self._objects.delete(key)
            return True
        return False

    def discard(self, blob: str) -> None:
        """Remove a blob that no row references and no process is about to write; it may be missing."""
        super().discard(blob)
        # An object that cannot be removed now is removed by a sweep.
        with suppress(ObjectStoreError):
            self._objects.delete(_key(blob))

    def _observe_object(self, name: str, outcome: str, seconds: float) -> None:
        self.observe_object(name, outcome, seconds)

    def _fetch(self, blob: str, held: Path) -> None:
        """Provide a blob under a path: by a link to the cache, to which it is added if it is not there."""
        with suppress(FileNotFoundError):
            os.link(self._at(blob), held)
            os.utime(held)  # time of the last use
            return
        self._download(blob, held)
        with held.open("rb") as stream:
            os.fsync(stream.fileno())
        self._at(blob).parent.mkdir(exist_ok=True, mode=0o700)
        with suppress(FileExistsError):
            os.link(held, self._at(blob))
        self._make_room(held)

    def _download(self, blob: str, target: Path) -> None:
        """Download a blob, again if its bytes are not those of its name."""
        for _ in range(_DOWNLOADS):
            if not any(self._get(key, target) for key in (_key(blob), _binned(blob))):
                raise BlobNotFoundError(
                    f"the object {_key(blob)} is not in {self._objects.url}: restore it from a backup, or "
                    "copy it from where the service stored it before"
                )
            if hash_file(target) == blob:
                return
            log.warning("damaged download", blob=blob)
        raise BlobNotFoundError(
            f"the object {_key(blob)} in {self._objects.url} is damaged: restore it from a backup"
        )

    def _get(self, key: str, target: Path) -> bool:
        try:
            self._objects.get(key, target)
        except ObjectNotFoundError:
            return False
        return True

    def _make_room(self, added: Path) -> None:
        """Remove the files whose last use is longest ago, if the cache is too large."""
        with suppress(FileNotFoundError):
            self._room -= added.stat().st_size
        if self._room >= 0:
            return
        found = []
        for blob, path in super().all():
            with suppress(FileNotFoundError):
                about = path.stat()
                if blob:
                    found.append((about.st_mtime, about.st_size, path))
                elif about.st_mtime < time() - _PART_AGE:
                    path.unlink()
        total = sum(size for _, size, _ in found)
        if total > self._most_bytes:
            for _, size, path in sorted(found):
                if total <= _LEFT_SHARE * self._most_bytes:
                    break
                path.unlink(missing_ok=True)
                total -= size
        # Other processes add files as well: count again after a fifth of the rest.
        self._room = max(0, self._most_bytes - total) // 5


def _key(blob: str) -> str:
    return f"{blob[:2]}/{blob}"


def _binned(blob: str) -> str:
    return f"unnamed/{blob}"


def open_blobs(settings: ServiceSettings) -> Blobs:
    """Open the blobs of a service: in its object store, or else in its data folder.

    Raises
    ------
    SettingsError
        The extra ``s3`` is not installed.
    """
    if not settings.blob_store:
        return Blobs(settings.blobs)
    return CachedBlobs(settings.blobs, ObjectStore(settings.blob_store), settings.blob_cache)
