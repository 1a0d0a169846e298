"""Compressed files: gzip of one file, and zip archives with one record."""

import gzip
import shutil
import tempfile
import weakref
import zipfile
import zlib
from collections.abc import Callable, Collection
from pathlib import Path, PurePosixPath
from typing import IO

from islands.errors import RecordError
from islands.records.reading.size_limits import RecordArchive, check_unpacked
from islands.records.reading.table import Table

#: Suffixes of compressed files.
PACKED = (".gz", ".zip")

_CHUNK = 1 << 20

_DAMAGED = (
    OSError,
    EOFError,
    RuntimeError,
    zlib.error,
    zipfile.BadZipFile,
)


def open_packed(path: Path, known: Collection[str], opened: Callable[[Path], Table]) -> Table:
    """Open the record in a compressed file.

    Parameters
    ----------
    path : Path
        A file with a suffix of `PACKED`.
    known : collection of str
        Suffixes of the supported formats.
    opened : callable
        Opens an unpacked file.

    Raises
    ------
    RecordError
        The file is damaged, contains no supported file or several, or unpacks to too many bytes.
    """
    folder = tempfile.mkdtemp(prefix="islands-record-")
    try:
        table = opened(_unpack(path, Path(folder), known))
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    # Arrays are read on demand, so the unpacked file exists as long as its table.
    weakref.finalize(table, shutil.rmtree, folder, ignore_errors=True)
    return table


def _unpack(path: Path, folder: Path, known: Collection[str]) -> Path:
    try:
        if path.suffix.lower() == ".gz":
            target = folder / path.stem
            with gzip.open(path) as source:
                _copy(source, target, path.name)
            return target
        with RecordArchive(path) as archive:
            member = _choose_member(archive, path.name, known)
            check_unpacked(member.file_size, path.name)
            target = folder / PurePosixPath(member.filename).name
            with archive.open(member) as source:
                _copy(source, target, path.name)
            return target
    except _DAMAGED as error:
        raise RecordError(
            f"{path.name} is damaged or encrypted ({error}): compress the record again"
        ) from error


def _copy(source: IO[bytes] | gzip.GzipFile, target: Path, file: str) -> None:
    size = 0
    with target.open("wb") as stream:
        while chunk := source.read(_CHUNK):
            size += len(chunk)
            check_unpacked(size, file)
            stream.write(chunk)


def _choose_member(archive: zipfile.ZipFile, file: str, known: Collection[str]) -> zipfile.ZipInfo:
    """Return the single member that is a record. Hidden files and those of macOS are ignored."""
    members = [
        member
        for member in archive.infolist()
        if not member.is_dir()
        and not member.filename.startswith("__MACOSX/")
        and not PurePosixPath(member.filename).name.startswith(".")
    ]
    records = [member for member in members if PurePosixPath(member.filename).suffix.lower() in known]
    records = members if len(members) == 1 else records  # its content decides
    if len(records) == 1:
        return records[0]
    listed = ", ".join(member.filename for member in (records or members)[:10]) or "no files"
    if records:
        raise RecordError(f"{file} contains {len(records)} records, {listed}: extract the one to read")
    raise RecordError(f"{file} contains no record ({listed}): its name must end in one of {', '.join(known)}")
