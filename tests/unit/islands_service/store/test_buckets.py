"""`ObjectStore`, and its substitute of other tests, on a simulated S3: lost connections, refusals."""

import os
from collections import Counter
from hashlib import sha256
from time import monotonic, time

import pytest

from islands_service.store import buckets
from islands_service.store.blobs import BlobNotFoundError
from islands_service.store.buckets import (
    ObjectNotFoundError,
    ObjectStore,
    ObjectStoreError,
    ObjectStoreRefusedError,
)
from islands_service.store.cached_blobs import CachedBlobs
from support.object_stores import (
    ACCESS,
    CuttingProxy,
    MemoryObjects,
    authentication,
    make_bucket,
    s3_server,
)

pytestmark = pytest.mark.ci

URL = "s3://bucket/a/prefix"


@pytest.fixture(scope="module")
def endpoint():
    with pytest.MonkeyPatch.context() as patch, s3_server(patch) as endpoint:
        make_bucket(endpoint)
        yield endpoint


@pytest.fixture(autouse=True)
def short_pauses(monkeypatch):
    monkeypatch.setattr(buckets, "RETRY_PAUSES", (0.01, 0.02))


@pytest.fixture
def proxy(endpoint, monkeypatch):
    host, _, port = endpoint.removeprefix("http://").partition(":")
    with CuttingProxy((host, int(port))) as proxy:
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{proxy.port}")
        yield proxy


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"content")
    return path


def fetched(objects, key, folder):
    objects.get(key, folder / "fetched")
    return (folder / "fetched").read_bytes()


@pytest.mark.parametrize("kind", ["s3", "memory"])
def test_objects_are_stored_listed_renamed_and_deleted(kind, endpoint, file, tmp_path):
    objects = ObjectStore("s3://bucket/kind/") if kind == "s3" else MemoryObjects()
    objects.check()
    with pytest.raises(ObjectNotFoundError):
        objects.get("aa/b", tmp_path / "none")
    objects.put("aa/b", file)
    file.write_bytes(b"")
    objects.put("aa/empty", file)
    listed = {key: at for key, at in objects.all() if key != "islands-store"}
    assert listed.keys() == {"aa/b", "aa/empty"}
    assert all(abs(at - time()) < 60.0 for at in listed.values())
    assert [fetched(objects, key, tmp_path) for key in listed] == [b"content", b""]
    objects.move("aa/b", "unnamed/b")
    with pytest.raises(ObjectNotFoundError):
        objects.move("aa/b", "unnamed/c")
    assert fetched(objects, "unnamed/b", tmp_path) == b"content"
    for key in ("unnamed/b", "unnamed/b", "aa/empty"):
        objects.delete(key)
    assert {key for key, _ in objects.all()} <= {"islands-store"}


def test_large_objects_are_transferred_in_parts(endpoint, tmp_path, monkeypatch):
    monkeypatch.setattr(buckets, "_PART_BYTES", 5 * 2**20)
    blobs = CachedBlobs(tmp_path / "one", ObjectStore(URL), 10**9)
    data = os.urandom(12 * 2**20)
    blob = blobs.write(data)
    assert CachedBlobs(tmp_path / "other", ObjectStore(URL), 10**9).read(blob) == data
    stored = make_bucket(endpoint).head_object(Bucket="bucket", Key=f"a/prefix/{blob[:2]}/{blob}")
    assert stored["ETag"].endswith('-3"')  # the number of parts


def test_a_partial_upload_is_never_read_as_the_blob(proxy, tmp_path):
    """The upload was cut at every attempt: no name was returned, and a later upload is complete."""
    data = os.urandom(2_000_000)
    blobs = CachedBlobs(tmp_path / "one", ObjectStore(URL), 10**9)
    proxy.cut_after = [300_000] * 100
    with pytest.raises(ObjectStoreError):
        blobs.write(data)
    proxy.cut_after.clear()
    other = CachedBlobs(tmp_path / "other", ObjectStore(URL), 10**9)
    with pytest.raises(BlobNotFoundError):
        other.read(sha256(data).hexdigest())
    assert other.read(blobs.write(data)) == data


def test_a_download_whose_connection_is_cut_is_repeated(proxy, tmp_path):
    data = os.urandom(2_000_000)
    blob = CachedBlobs(tmp_path / "one", ObjectStore(URL), 10**9).write(data)
    other = CachedBlobs(tmp_path / "other", ObjectStore(URL), 10**9)
    outcomes = Counter()
    other.observe_object = lambda name, outcome, _: outcomes.update([(name, outcome)])
    proxy.cut_answer_after = [300_000]
    assert other.read(blob) == data
    assert outcomes == {("get", "unavailable"): 1, ("get", "done"): 1}


def test_a_store_that_is_absent_at_the_start_and_returns(proxy, tmp_path):
    proxy.refuse = True
    blobs = CachedBlobs(tmp_path / "one", ObjectStore(URL), 10**9)
    blobs.check_settings()
    with pytest.raises(ObjectStoreError, match="does not answer"):
        blobs.check_writable()
    started = monotonic()
    with pytest.raises(ObjectStoreError, match="AWS_ENDPOINT_URL"):
        blobs.write(b"record")
    assert monotonic() - started < 20.0
    proxy.refuse = False
    blobs.check_writable()
    assert blobs.read(blobs.write(b"record")) == b"record"


def test_wrong_credentials_are_refused_without_another_attempt(endpoint, file):
    seen = []
    objects = ObjectStore(URL)
    objects.observe = lambda *call: seen.append(call[:2])
    with authentication(endpoint), pytest.raises(ObjectStoreRefusedError) as caught:
        objects.put("a", file)
    assert "(InvalidAccessKeyId): check the credentials" in str(caught.value)
    assert ACCESS["AWS_SECRET_ACCESS_KEY"] not in str(caught.value)
    assert seen == [("put", "refused")]
    objects.put("a", file)
