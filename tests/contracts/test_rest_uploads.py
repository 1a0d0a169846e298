"""Uploads in progress: number, quota, time and files are bounded before and while the body arrives."""

import asyncio
import json
import resource
import socket
import time
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import pytest

from islands_service.intake.file_inspection import count_slots
from support.bad_records import write_hdf5_bomb, write_mat_bomb, write_parquet_bomb
from support.processes import eventually
from support.service import csv, problem_of

#: Beginning of a form whose file never ends.
START = b'--b\r\nContent-Disposition: form-data; name="file"; filename="a.csv"\r\n\r\nt_s,u_V,y_um\r\n'


@pytest.fixture(scope="module")
def shared(serve):
    limits = {"max_uploads": 3, "max_uploads_per_owner": 2, "max_stored": 5_000_000, "max_upload": 9_000_000}
    with serve(require_keys=True, rate=0.0, **limits) as running:
        yield running


@pytest.fixture
def impatient(service):
    """The service with short times for a body."""
    state = service.app.state.islands
    settings = state.settings.model_copy(update={"body_timeout": 0.4, "body_rate": 2_000.0})
    service.app.state.islands = replace(state, settings=settings)
    yield service
    service.app.state.islands = state


@contextmanager
def started(service, headers, length=100_000):
    """Begin an upload that declares a length; yield its connection."""
    lines = [
        "POST /v1/datasets HTTP/1.1",
        "Host: 127.0.0.1",
        f"Authorization: {headers['Authorization']}",
        "Content-Type: multipart/form-data; boundary=b",
        *([f"Content-Length: {length}"] if length else ["Transfer-Encoding: chunked"]),
    ]
    with socket.create_connection(("127.0.0.1", service.port), timeout=10.0) as connection:
        connection.sendall("\r\n".join([*lines, "", ""]).encode() + (START if length else b""))
        yield connection


def answer(connection):
    """Return the status, the type, the detail and the headers of a problem."""
    with connection.makefile("rb") as stream:
        status = int(stream.readline().split()[1])
        headers = {}
        while line := stream.readline().strip().decode():
            name, _, value = line.partition(": ")
            headers[name.lower()] = value
        problem = json.loads(stream.read(int(headers["content-length"])))
    assert headers["content-type"] == "application/problem+json"
    return status, problem["type"].removeprefix("/problems/"), problem["detail"], headers


def spooled():
    """Return the nameless files that this process, which contains the service, has open."""
    found = []
    for link in Path("/proc/self/fd").iterdir():
        try:
            target = str(link.readlink())
        except OSError:
            continue
        if target.endswith("(deleted)") and "memfd" not in target:
            found.append(Path(target))
    return found


def resident_bytes():
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def size(spooled_file):
    """Return the bytes of a nameless file of this process."""
    for link in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            if link.readlink() == spooled_file:
                return link.stat().st_size
    return 0


def receiving(service):
    return [path for path in spooled() if path.parent == service.settings.blobs]


def test_uploads_in_progress_are_limited_per_owner_and_in_total(service):
    one, two, three = (service.key(owner=f"owner {number}") for number in range(3))
    with ExitStack() as stack:
        for headers in (one, one):
            stack.enter_context(started(service, headers))
        eventually(lambda: len(receiving(service)) == 2)
        refused = service.upload(csv(), "c.csv", one)
        assert "2 uploads of this owner are in progress" in problem_of(refused, 429, "too-many-uploads")
        assert int(refused.headers["retry-after"]) >= 1
        assert service.upload(csv(), "c.mf4", two).status_code == 422
        stack.enter_context(started(service, three))
        eventually(lambda: len(receiving(service)) == 3)
        refused = service.upload(csv(300), "c.csv", two)
        assert "3 uploads are in progress, the most of this service" in problem_of(
            refused, 429, "too-many-uploads"
        )
    eventually(lambda: service.upload(csv(), "c.mf4", one).status_code == 422)
    eventually(lambda: not receiving(service))


@pytest.mark.parametrize("trickle", [b"", b"0,"])
def test_a_body_that_stalls_or_is_too_slow_is_a_problem_and_frees_everything(impatient, trickle):
    with started(impatient, impatient.key()) as connection:
        start = time.monotonic()
        while trickle and time.monotonic() - start < 20.0:
            try:
                connection.sendall(trickle)
            except OSError:
                break
            time.sleep(0.05)
            connection.settimeout(0.001)
            try:
                if connection.recv(1, socket.MSG_PEEK) is not None:
                    break
            except TimeoutError:
                continue
            finally:
                connection.settimeout(10.0)
        status, kind, _, headers = answer(connection)
        assert time.monotonic() - start < 15.0
        assert (status, kind, headers["connection"]) == (408, "request-timeout", "close")
        with suppress(ConnectionResetError):  # by a byte that the service received after it had closed
            assert connection.recv(1) == b""
    assert not receiving(impatient)


def test_a_declared_length_above_the_quota_is_refused_before_the_body(service):
    headers = service.key()
    with started(service, headers, 6_000_000) as connection:
        status, kind, detail, _ = answer(connection)
    assert (status, kind) == (429, "quota-exceeded")
    assert "this one has 5.9 MB, and 5.0 MB is the most" in detail


def test_uploads_in_progress_count_towards_the_quota(service):
    headers = service.key()
    with started(service, headers, 4_000_000):
        eventually(lambda: len(receiving(service)) == 1)
        with started(service, headers, 4_000_000) as connection:
            assert "uploads in progress 3.9 MB" in answer(connection)[2]


def test_a_body_of_undeclared_length_ends_at_the_quota(service):
    sent = 0
    with started(service, service.key(), None) as connection:
        chunk = b"0" * 65536
        connection.sendall(b"%x\r\n%s\r\n" % (len(START), START))
        connection.settimeout(20.0)
        while sent < 8_000_000:
            connection.sendall(b"%x\r\n%s\r\n" % (len(chunk), chunk))
            sent += len(chunk)
        assert answer(connection)[:2] == (429, "quota-exceeded")
    assert not receiving(service)


def test_bodies_in_progress_are_on_the_disk_and_not_in_memory(service):
    eventually(lambda: not receiving(service))
    block = b"0,1,2,3,\n0" * 10_000
    with ExitStack() as stack:
        before = resident_bytes()
        for _ in range(3):
            connection = stack.enter_context(started(service, service.key(), 5_000_000))
            for _ in range(48):
                connection.sendall(block)
        eventually(lambda: sum(map(size, receiving(service))) > 3 * 4_500_000)
        assert resident_bytes() - before < 6_000_000
    eventually(lambda: not receiving(service))


def test_a_key_without_the_scope_is_refused_before_the_body(service):
    with started(service, service.key("read")) as connection:
        assert answer(connection)[1] == "scope-missing"


def test_a_small_record_does_not_wait_for_large_ones_of_others(service):
    """Their inspections may take two minutes each."""
    state, headers = service.app.state.islands, service.key()
    largest = count_slots(state.settings.max_unpacked)

    async def upload_during_large_ones():
        async with state.inspection_slots.hold("a", largest), state.inspection_slots.hold("b", largest):
            return await asyncio.to_thread(
                service.client.post,
                *("/v1/datasets",),
                files={"file": ("a.csv", csv())},
                headers=headers,
                timeout=20.0,
            )

    assert asyncio.run(upload_during_large_ones()).status_code == 201


@pytest.mark.ci
@pytest.mark.parametrize("write", [write_hdf5_bomb, write_mat_bomb, write_parquet_bomb])
def test_a_small_file_that_unpacks_to_a_gigabyte_is_refused_in_every_format(service, tmp_path, write):
    """Its reader has memory in proportion to the bytes of the file."""
    path = write(tmp_path)
    assert path.stat().st_size < 2_000_000
    answer = service.upload(path.read_bytes(), path.name, service.key())
    detail = problem_of(answer, 422, "invalid-record")
    assert f"{path.name} cannot be read within" in detail
    assert "unpacks to more than this service accepts" in detail
