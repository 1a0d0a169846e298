"""Invalid input over REST is rejected with a message that locates the error, and nothing is stored."""

import gzip
import io
import struct
import zipfile
import zlib

import pytest
from numpy.lib import format as npy

from support.service import (
    csv,
    matlab_5,
    matlab_73,
    nothing_stored,
    problem_of,
    served,
)

#: Memory budget of the inspection process, in bytes.
MEMORY = 1_000_000_000

#: Largest size of an unpacked file, in bytes.
UNPACKED = 50_000_000

#: First bytes of a picture.
PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(256))


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("service")
    with served(folder, inspection_memory=MEMORY, max_unpacked=UNPACKED) as service:
        yield service


@pytest.fixture
def service(shared):
    """A service without jobs and data sets, before and after a test."""
    assert nothing_stored(shared)
    yield shared
    for job in shared.client.get("/v1/jobs").json()["items"]:
        shared.client.post(f"/v1/jobs/{job['id']}/cancel")
        shared.client.delete(f"/v1/jobs/{job['id']}")
    for dataset in shared.client.get("/v1/datasets").json()["items"]:
        assert shared.client.delete(f"/v1/datasets/{dataset['id']}").status_code == 204
    for path in shared.settings.blobs.rglob("??/*"):
        path.unlink()


def make_header(samples):
    """Return the header of a column in NumPy's format."""
    stream = io.BytesIO()
    npy.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": (samples,)})
    return stream.getvalue()


def make_archive_with_false_size(samples, stored=64):
    """Return an archive whose headers claim more samples than it stores."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name in ("u", "y"):
            archive.writestr(f"{name}.npy", make_header(samples) + bytes(stored))
    return stream.getvalue()


def make_zip_bomb(samples, members, declared=None):
    """Return an archive of zeros that unpacks to a thousand times its size; its checksums are not valid.

    Its directory declares the true size of each member, or another one.
    """
    pack = zlib.compressobj(9, zlib.DEFLATED, -15)
    head, block = make_header(samples), bytes(1 << 20)
    blocks = 8 * samples // len(block)
    packed = pack.compress(head) + pack.flush(zlib.Z_FULL_FLUSH)
    packed += (pack.compress(block) + pack.flush(zlib.Z_FULL_FLUSH)) * blocks + pack.flush()
    files, directory = b"", b""
    for member in range(members):
        name = b"u%d.npy" % member
        size = declared or len(head) + blocks * len(block)
        entry = struct.pack("<5H3L2H", 20, 0, 8, 0, 0x21, 0, len(packed), size, len(name), 0)
        directory += b"PK\1\2\x14\0" + entry + struct.pack("<3H2L", 0, 0, 0, 0, len(files)) + name
        files += b"PK\3\4" + entry + name + packed
    sizes = (0, 0, members, members, len(directory), len(files), 0)
    return files + directory + b"PK\5\6" + struct.pack("<4H2LH", *sizes)


#: Unusable files: content, name, and parts of the message.
UNUSABLE = {
    "empty": (b"", "a.csv", ("a.csv is empty", "export the record again")),
    "header alone": (b"t_s,u_V,y_um\n", "a.csv", ("a header in line 1 but no samples",)),
    "picture": (PNG, "a.csv", ("a.csv is not a text file", "export the record as text")),
    "2 GB header": (
        make_archive_with_false_size(2**28),
        "a.npz",
        (f"column u declares {2**28} samples", "the file is damaged"),
    ),
    "0.8 GB header": (
        make_archive_with_false_size(10**8),
        "a.npz",
        ("declares 800000000 bytes, but the file stores 64", "write it"),
    ),
    "MAT 5 cut short": (matlab_5()[:2000], "a.mat", ("a.mat is damaged or truncated", "save it")),
    "MAT 7.3 cut short": (matlab_73()[:3000], "a.mat", ("a.mat is damaged or truncated", "save it")),
    "long name": (
        csv().replace(b"y_um", b"y" * 100_000),
        "a.csv",
        (f"line 1: the column {'y' * 40}... has a name of 100000 characters", "at most 1000", "shorter"),
    ),
    "no gzip": (
        csv(),
        "a.csv.gz",
        ("a.csv.gz is not a gzip file, or is damaged", "compress the record again"),
    ),
    "gzip cut short": (
        gzip.compress(csv())[:-50],
        "a.csv.gz",
        ("is not a gzip file, or is damaged", "compress"),
    ),
    "line cut short": (
        csv() + b"2.0,1.0\n",
        "a.csv",
        ("a.csv, line 202, column y_um", "2 cells for 3 columns"),
    ),
}


@pytest.mark.ci
@pytest.mark.parametrize("case", UNUSABLE)
def test_unusable_file_is_rejected_and_not_stored(service, case):
    content, name, words = UNUSABLE[case]
    detail = problem_of(service.upload(content, name), 422, "invalid-record")
    for word in words:
        assert word in detail
    assert nothing_stored(service)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("declared", "reason"), [(None, "a.npz unpacks to more than 1 GiB"), (1000, "a.npz")]
)
def test_zip_bomb_is_refused_whether_its_directory_is_true_or_not(service, declared, reason):
    packed = make_zip_bomb(samples=1 << 27, members=2, declared=declared)
    assert len(packed) < 3_000_000
    assert reason in problem_of(service.upload(packed, "a.npz"), 422, "invalid-record")
    assert nothing_stored(service)
