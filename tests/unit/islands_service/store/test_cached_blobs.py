"""`CachedBlobs`: stored before a row can name them, cached within a limit, swept in two steps."""

import os
from hashlib import sha256
from time import time

import pytest

from islands.errors import SettingsError
from islands_service.settings import ServiceSettings, service_settings
from islands_service.store import cached_blobs
from islands_service.store.blobs import BlobNotFoundError
from islands_service.store.buckets import (
    ObjectStoreError,
    ObjectStoreRefusedError,
)
from islands_service.store.cached_blobs import CachedBlobs, open_blobs
from support.object_stores import MemoryObjects

LIMIT = 1000


@pytest.fixture
def objects():
    return MemoryObjects()


@pytest.fixture
def machine(tmp_path, objects, monkeypatch):
    """Make the blobs of a machine, whose folder is its own."""
    monkeypatch.setattr(cached_blobs, "SWEEP_SECONDS", 0.0)
    return lambda name="here": CachedBlobs(tmp_path / name, objects, LIMIT)


def cached(blobs):
    return sorted(blob for blob, _ in blobs.all() if blob)


def key(blob):
    return f"{blob[:2]}/{blob}"


def test_a_blob_is_readable_on_another_machine_which_downloads_it_once(machine, objects):
    blob = machine("one").write(b"record")
    assert blob == sha256(b"record").hexdigest()
    other = machine("other")
    assert [other.read(blob), other.read(blob)] == [b"record"] * 2
    assert objects.calls == ["put", "get"]


def test_a_blob_that_cannot_be_uploaded_has_no_name_and_leaves_nothing(machine, objects, tmp_path):
    objects.away = True
    with pytest.raises(ObjectStoreError):
        machine().write(b"record")
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_damaged_object_is_not_read(machine, objects, tmp_path):
    blob = machine().write(b"record")
    objects.objects[key(blob)] = b"rec"
    with pytest.raises(BlobNotFoundError, match="damaged: restore it from a backup"):
        machine("other").read(blob)
    assert not [path for path in (tmp_path / "other").rglob("*") if path.is_file()]


def test_a_missing_object_raises_an_error_that_names_the_store(machine):
    with pytest.raises(BlobNotFoundError, match="s3://memory: restore it from a backup, or copy"):
        machine().read("0" * 64)


def test_the_cache_drops_what_was_not_used_for_longest(machine, objects):
    blobs = machine()
    written = [blobs.write(bytes([index]) * 200) for index in range(4)]
    for age, blob in enumerate(reversed(written)):
        os.utime(blobs.path(blob), (time() - 60 * age - 60,) * 2)
    assert blobs.read(written[0]) == bytes(200)  # now the last one used
    for index in range(4, 7):
        written.append(blobs.write(bytes([index]) * 200))
        assert sum(len(objects.objects[key(blob)]) for blob in cached(blobs)) <= LIMIT
    assert written[0] in cached(blobs)
    assert written[1] not in cached(blobs)
    assert [blobs.read(blob) for blob in written] == [bytes([index]) * 200 for index in range(7)]


def test_files_of_processes_that_were_killed_are_removed(machine, tmp_path):
    blobs = machine()
    old, young = tmp_path / "here/old.part", tmp_path / "here/young.part"
    for path in (old, young):
        path.touch()
    os.utime(old, (1e9, 1e9))
    blobs.write(b"record")
    assert [old.exists(), young.exists()] == [False, True]


def test_an_unreferenced_object_is_deleted_by_the_second_sweep_after_an_hour(machine, objects):
    blobs = machine()
    named, unnamed = blobs.write(b"named"), blobs.write(b"unnamed")
    assert blobs.sweep({named}, time() - 3600.0) == 0
    assert len(objects.objects) == 2  # too young
    for left in ({key(named), f"unnamed/{unnamed}"}, {key(named)}):
        objects.age()
        blobs.sweep({named}, time() - 3600.0)
        assert objects.objects.keys() == left


def test_a_blob_that_is_named_while_it_is_swept_stays_readable(machine, objects):
    """The sweep of one machine listed the object before another machine stored it once more."""
    blob = machine().write(b"record")
    objects.age()
    machine("sweeper").sweep(frozenset(), time() - 3600.0)
    assert key(blob) not in objects.objects
    assert machine("other").read(blob) == b"record"
    objects.age()
    machine("sweeper").sweep({blob}, time() - 3600.0)
    assert objects.objects.keys() == {key(blob)}


def test_discarding_needs_no_answer_of_the_store(machine, objects):
    blobs = machine()
    blob, other = blobs.write(b"checkpoint"), blobs.write(b"next")
    blobs.discard(blob)
    assert objects.objects.keys() == {key(other)}
    objects.away = True
    blobs.discard(other)


def test_settings_that_the_store_refuses_are_refused_and_an_absent_store_is_not(
    machine, objects, monkeypatch
):
    objects.away = True
    machine().check_settings()
    with pytest.raises(ObjectStoreError):
        machine().check_writable()

    def refuse():
        raise ObjectStoreRefusedError("the store refuses access: check the credentials")

    monkeypatch.setattr(objects, "check", refuse)
    with pytest.raises(SettingsError, match="check the credentials"):
        machine().check_settings()


@pytest.mark.parametrize(
    "url",
    ["s3://key:secret@bucket/a", "https://bucket/a", "s3://", "s3://Bucket", "s3://bucket/a?b", "bucket"],
)
def test_the_setting_names_a_bucket_without_credentials(url):
    with pytest.raises(SettingsError, match=r"ISLANDS_BLOB_STORE.*s3://BUCKET") as caught:
        service_settings(blob_store=url)
    assert "secret@" not in str(caught.value)


def test_without_an_object_store_blobs_are_in_the_data_folder(tmp_path):
    blobs = open_blobs(ServiceSettings(data_dir=tmp_path))
    assert blobs.path(blobs.write(b"a")).is_relative_to(tmp_path / "blobs")
