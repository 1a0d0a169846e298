"""`Blobs`: content-addressed, complete or absent, swept if unreferenced."""

import errno
import os
import time
from hashlib import sha256
from pathlib import Path

import pytest

from islands_service.store.blobs import BlobNotFoundError, Blobs, translate_disk_full
from islands_service.store.database import StorageFullError

LONG_AGO = 1_000_000.0


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "data" / "blobs"


@pytest.fixture
def blobs(folder):
    return Blobs(folder)


def files(folder):
    return sorted(path for path in folder.rglob("*") if path.is_file())


def aged(path):
    os.utime(path, (LONG_AGO, LONG_AGO))


@pytest.mark.parametrize("data", [b"", b"a", bytes(range(256)) * 5000])
def test_blob_holds_the_written_bytes_and_is_named_by_their_hash(blobs, data):
    blob = blobs.write(data)
    assert blob == sha256(data).hexdigest()
    assert blobs.read(blob) == data
    assert blobs.path(blob).read_bytes() == data


def test_the_same_bytes_are_one_file(blobs, folder):
    """A process that may open only this file is not disturbed, and a sweep finds it as young as a new one."""
    path = blobs.path(blobs.write(b"a"))
    before = path.stat().st_ino
    aged(path)
    assert blobs.path(blobs.write(b"a")) == path
    assert files(folder) == [path]
    assert path.stat().st_ino == before
    assert path.stat().st_mtime > time.time() - 60.0


def test_missing_blob_raises_an_error_with_advice(blobs, folder):
    with pytest.raises(BlobNotFoundError, match=f"{'0' * 64} is not in .*blobs: restore .* from a backup"):
        blobs.read("0" * 64)


def test_folder_is_not_accessible_to_other_users(blobs, folder):
    blobs.write(b"a")
    assert {path.stat().st_mode & 0o077 for path in (folder, *folder.rglob("*"))} == {0}


def test_received_file_that_is_not_kept_is_deleted(blobs, folder):
    with blobs.receiving() as stream:
        stream.write(b"a")
        assert len(files(folder)) == 1
    assert files(folder) == []


def test_kept_blob_survives_a_later_error(blobs, folder):
    def fails():
        with blobs.receiving() as stream:
            stream.write(b"a")
            blobs.keep(stream)
            raise ConnectionError

    with pytest.raises(ConnectionError):
        fails()
    assert blobs.read(sha256(b"a").hexdigest()) == b"a"
    assert len(files(folder)) == 1


def test_blob_and_its_folders_are_synced_before_its_name_is_returned(blobs, folder, monkeypatch):
    synced = []

    def fsync(descriptor):
        path = Path(f"/proc/self/fd/{descriptor}").readlink()
        synced.append((path, path.stat().st_size))

    monkeypatch.setattr(os, "fsync", fsync)
    blob = blobs.write(b"abc" * 10_000)
    (part, size), *folders = synced
    assert (part.parent, size) == (folder, 30_000)
    assert [path for path, _ in folders] == [folder / blob[:2], folder]


def test_old_unreferenced_blobs_are_swept(blobs):
    named, unnamed, young = (blobs.write(each) for each in (b"a", b"b", b"c"))
    for blob in (named, unnamed):
        aged(blobs.path(blob))
    assert blobs.sweep({named}, LONG_AGO) == 0
    assert blobs.sweep({named}, LONG_AGO + 1) == 1
    assert {blob for blob, _ in blobs.all()} == {named, young}
    assert blobs.sweep((), time.time() + 60) == 2


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_full_disk_raises_a_storage_full_error(number):
    with pytest.raises(StorageFullError, match="make room"), translate_disk_full():
        raise OSError(number, os.strerror(number))
