"""Uploads: file names are sanitised, and decompressed sizes are limited."""

import gzip
import hashlib
import io
import tempfile

import pytest

from islands.errors import RecordError
from islands_api.web.problems import PayloadTooLargeError
from islands_api.web.uploads import (
    find_stored_suffix,
    parse_file_name,
    receive,
)

#: File names of clients, and the names that are stored.
NAMES = {
    "record.csv": "record.csv",
    "../../x.csv": "x.csv",
    "/etc/passwd/x.csv": "x.csv",
    "..\\..\\x.csv": "x.csv",
    "C:\\data\\x.csv": "x.csv",
    "C:x.csv": "x.csv",
    "a\0b.csv": "ab.csv",
    "a\r\nb.csv": "ab.csv",
    "\u202efdp.csv": "fdp.csv",
    "\ud800.a.csv": "a.csv",
    ".hidden.csv": "hidden.csv",
    "x.CSV": "x.csv",
    "-rf.npz": "-rf.npz",
    "Messung größer.mat": "Messung größer.mat",
    "a b;c|d&e.tsv": "a b;c|d&e.tsv",
    "日本語.parquet": "日本語.parquet",
    "logger.log": "logger.log",
    "x.csv.Exe": "x.csv.Exe",
    "../Messung 3": "Messung 3",
    ".csv": "csv",
}


@pytest.mark.parametrize("given", NAMES)
def test_file_names_are_sanitised(given):
    assert parse_file_name(given) == (NAMES[given], False)
    assert parse_file_name(f"{given}.GZ") == (NAMES[given], True)


@pytest.mark.parametrize("given", [None, "", ".", "..", "/", "x.mf4", "x.MDF", "x.mf4.gz", ".mf4.mf4"])
def test_a_file_without_a_name_and_an_mdf_file_are_rejected(given):
    with pytest.raises(RecordError, match=r"does not end in \.mf4 or \.mdf: export .* \.csv, .*\.parquet"):
        parse_file_name(given)


@pytest.mark.parametrize("name", ["x.log", "x", "x.2026-11-22", "x.exe"])
def test_the_id_of_a_file_of_another_suffix_has_that_of_text(name):
    assert find_stored_suffix(name) == ".txt"
    assert find_stored_suffix(f"{name}.NPZ") == ".npz"


def describe(data):
    """Return the expected size and SHA-256."""
    return len(data), hashlib.sha256(data).hexdigest()


@pytest.mark.parametrize("spooled", [1, 1_000_000])
def test_gzip_is_decompressed_from_a_spooled_file(spooled):
    """The file is also open for writing, which `gzip.GzipFile` would take as its mode by default."""
    target = io.BytesIO()
    with tempfile.SpooledTemporaryFile(max_size=spooled) as source:
        source.write(gzip.compress(b"t,u\n") + gzip.compress(b"1,2\n"))
        source.seek(0)
        assert receive(source, target, "a.csv", True, 100) == describe(b"t,u\n1,2\n")
    assert target.getvalue() == b"t,u\n1,2\n"


@pytest.mark.parametrize("compressed", [False, True])
def test_a_file_one_byte_above_the_limit_is_rejected(compressed):
    sent = gzip.compress(b"x" * 100) if compressed else b"x" * 100
    assert receive(io.BytesIO(sent), io.BytesIO(), "a.csv", compressed, 100) == describe(b"x" * 100)
    with pytest.raises(PayloadTooLargeError) as refused:
        receive(io.BytesIO(sent), io.BytesIO(), "a.csv", compressed, 99)
    assert (
        refused.value.detail
        == "a.csv has more than 0 MB after decompression, the maximum here for a file of its size: "
        "send it uncompressed, or a part of the record"
    )


def test_a_gzip_bomb_is_not_decompressed_beyond_the_limit():
    target = io.BytesIO()
    with pytest.raises(PayloadTooLargeError):
        receive(io.BytesIO(gzip.compress(bytes(20_000_000))), target, "a.csv", True, 5_000_000)
    assert len(target.getvalue()) <= 5_000_000


@pytest.mark.parametrize(
    "sent",
    [b"t,u\n", gzip.compress(b"t,u\n")[:-4], gzip.compress(b"t,u\n" * 99)[:-12], b"\x1f\x8b\x08" + bytes(99)],
    ids=["none", "without its end", "cut short", "zeros"],
)
def test_a_damaged_gzip_file_is_rejected(sent):
    with pytest.raises(
        RecordError, match=r"a\.csv\.gz is not a gzip file, or is damaged \(.+\): compress the record again"
    ):
        receive(io.BytesIO(sent), io.BytesIO(), "a.csv", True, 1000)
