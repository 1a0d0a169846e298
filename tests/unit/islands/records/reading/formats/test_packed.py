"""Compressed files: one record is read, and no file unpacks to more than the limit."""

import gzip
import os
import tempfile
import zipfile

import pytest

from islands.errors import RecordError
from islands.records.reading import read_record
from support.bad_records import lines

TEXT = ("\n".join(lines()) + "\n").encode()


def refusal(path):
    try:
        read_record(path, ["u_V"], "y_um")
    except RecordError as error:  # without a reference to the traceback, which contains the table
        return str(error)
    pytest.fail("the file is read")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Unpack into an empty folder, which is empty again at the end."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", os.fspath(folder))
    yield folder
    assert list(folder.iterdir()) == []


def test_a_bomb_is_refused_while_it_unpacks(tmp_path, monkeypatch):
    monkeypatch.setattr("islands.records.reading.size_limits.MOST_UNPACKED", 500)
    monkeypatch.setattr("islands.records.reading.formats.packed._CHUNK", 256)
    (tmp_path / "r.csv.gz").write_bytes(gzip.compress(TEXT))
    assert "r.csv.gz unpacks to more than" in refusal(tmp_path / "r.csv.gz")
    with zipfile.ZipFile(tmp_path / "r.zip", "w") as archive:
        archive.writestr("../../r.csv", TEXT)
    assert "r.zip unpacks to more than" in refusal(tmp_path / "r.zip")


def test_the_folders_of_a_member_are_not_made(tmp_path, folder):
    with zipfile.ZipFile(tmp_path / "r.zip", "w") as archive:
        archive.writestr("../../../outside/r.csv", TEXT)
    assert read_record(tmp_path / "r.zip", ["u_V"], "y_um").samples == 60
    assert not (tmp_path / "outside").exists()


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("r.csv.gz", b"plain text", "is damaged or encrypted"),
        ("r.csv.gz", gzip.compress(TEXT, mtime=0)[:-20], "is damaged or encrypted"),
        ("r.gz", gzip.compress(b"\0\1" * 50, mtime=0), "r: files ending in '' are not supported"),
        ("r.zip", b"plain text", "is damaged or encrypted"),
    ],
)
def test_a_damaged_or_nameless_file_is_refused(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    assert words in refusal(tmp_path / name)


def test_an_archive_without_a_record_lists_its_files(tmp_path):
    with zipfile.ZipFile(tmp_path / "r.zip", "w") as archive:
        archive.writestr("readme.md", "x")
        archive.writestr("notes.md", "x")
    assert "r.zip contains no record (readme.md, notes.md): its name must end in one of .csv" in refusal(
        tmp_path / "r.zip"
    )
