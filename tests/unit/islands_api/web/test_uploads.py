"""Uploads: a stranger's name for a file names nothing else, and no more bytes come out than are allowed."""

import gzip
import hashlib
import io
import tempfile

import pytest

from islands.errors import RecordError
from islands_api.web.problems import PayloadTooLargeError
from islands_api.web.uploads import MAX_NAME_BYTES, parse_file_name, receive

#: What strangers call a file, and what we do.
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
}


@pytest.mark.parametrize("given", NAMES)
def test_a_name_is_a_file_of_its_own_in_no_folder(given):
    assert parse_file_name(given) == (NAMES[given], False)
    assert parse_file_name(f"{given}.GZ") == (NAMES[given], True)


@pytest.mark.parametrize("given", ["x" * 10_240, "ü" * 300, "😀" * 300])
def test_a_long_name_is_cut_to_what_a_file_may_be_called(given, tmp_path):
    name, _ = parse_file_name(f"{given}.csv")
    assert given.startswith(name.removesuffix(".csv"))
    assert MAX_NAME_BYTES - 4 < len(name.encode()) <= MAX_NAME_BYTES
    (tmp_path / name).touch()


@pytest.mark.parametrize(
    "given", [None, "", ".", "..", "/", ".csv", "..csv", "csv", "x.exe", "x.csv.exe", ".gz"]
)
def test_a_name_that_tells_no_format_is_refused(given):
    with pytest.raises(
        RecordError, match=r"its name must end in one of \.csv, .*\.parquet.* export the record"
    ):
        parse_file_name(given)


def told(data):
    """What is said of bytes that were received."""
    return len(data), hashlib.sha256(data).hexdigest()


def test_what_is_received_is_what_was_sent():
    sent, target = b"0123456789" * 300_000, io.BytesIO()
    assert receive(io.BytesIO(sent), target, "a.csv", False, len(sent)) == told(sent)
    assert target.getvalue() == sent


@pytest.mark.parametrize("spooled", [1, 1_000_000])
def test_a_gzip_is_unpacked_from_a_file_as_the_framework_hands_it_over(spooled):
    """It is open for writing too, which gzip takes for a wish to write."""
    target = io.BytesIO()
    with tempfile.SpooledTemporaryFile(max_size=spooled) as source:
        source.write(gzip.compress(b"t,u\n") + gzip.compress(b"1,2\n"))
        source.seek(0)
        assert receive(source, target, "a.csv", True, 100) == told(b"t,u\n1,2\n")
    assert target.getvalue() == b"t,u\n1,2\n"


@pytest.mark.parametrize("compressed", [False, True])
def test_one_byte_too_many_is_refused(compressed):
    sent = gzip.compress(b"x" * 100) if compressed else b"x" * 100
    assert receive(io.BytesIO(sent), io.BytesIO(), "a.csv", compressed, 100) == told(b"x" * 100)
    with pytest.raises(PayloadTooLargeError) as refused:
        receive(io.BytesIO(sent), io.BytesIO(), "a.csv", compressed, 99)
    assert refused.value.detail == "a.csv has more than 0 MB after decompression, the maximum here"


def test_a_bomb_is_never_unpacked_beyond_the_limit():
    target = io.BytesIO()
    with pytest.raises(PayloadTooLargeError):
        receive(io.BytesIO(gzip.compress(bytes(20_000_000))), target, "a.csv", True, 5_000_000)
    assert len(target.getvalue()) <= 5_000_000


@pytest.mark.parametrize(
    "sent",
    [b"t,u\n", gzip.compress(b"t,u\n")[:-4], gzip.compress(b"t,u\n" * 99)[:-12], b"\x1f\x8b\x08" + bytes(99)],
    ids=["none", "without its end", "cut short", "zeros"],
)
def test_a_damaged_gzip_is_refused(sent):
    with pytest.raises(
        RecordError, match=r"a\.csv\.gz is not a gzip file, or is damaged \(.+\): compress the record again"
    ):
        receive(io.BytesIO(sent), io.BytesIO(), "a.csv", True, 1000)


@pytest.mark.parametrize(
    ("sent", "compressed"),
    [(b"", False), (b"", True), (gzip.compress(b""), True)],
    ids=["plain", "no gzip", "gzip of nothing"],
)
def test_nothing_is_refused(sent, compressed):
    with pytest.raises(RecordError, match=r"a\.csv is empty: export the record again"):
        receive(io.BytesIO(sent), io.BytesIO(), "a.csv", compressed, 1000)
