"""Uploads: sanitise the file name, decompress and copy the bytes of an untrusted file."""

import gzip
import hashlib
import zlib
from pathlib import PurePosixPath, PureWindowsPath
from typing import IO

from islands.errors import ModelError, RecordError
from islands.records.reading import READERS
from islands_api.web.problems import PayloadTooLargeError
from islands_service.domain.uploaded_fmu import FMU_SUFFIX

#: Number of bytes that are copied at once.
CHUNK_BYTES = 1 << 20

#: Suffixes that are refused. The reader of MDF writes temporary files, which the inspection forbids.
_REFUSED = (".mf4", ".mdf")

#: Suffixes of uploads; the content of a file with another one decides.
SUFFIXES = tuple(suffix for suffix in READERS if suffix not in _REFUSED)

#: Suffix in the id of a data set whose own suffix is not that of a format.
_OTHER = ".txt"

#: Maximum length in bytes of a file name.
MAX_NAME_BYTES = 200

#: Suffix of compressed files.
GZIP_SUFFIX = ".gz"


def parse_file_name(given: str | None) -> tuple[str, bool]:
    """Return the name of a file, without folders and without .gz, and whether the file is compressed.

    Raises
    ------
    RecordError
        The file has no name, or is an MDF file.
    """
    name = PurePosixPath(PureWindowsPath(given or "").name).name
    name = "".join(character for character in name if character.isprintable()).lstrip(".")
    compressed = name.lower().endswith(GZIP_SUFFIX)
    name = name[: -len(GZIP_SUFFIX)] if compressed else name
    suffix = PurePosixPath(name).suffix.lower()
    if not name or suffix in _REFUSED:
        raise RecordError(
            f"{name or 'the file'}: a service reads files of a name that does not end in "
            f"{' or '.join(_REFUSED)}: export the record as one of {', '.join(SUFFIXES)}, or {GZIP_SUFFIX}"
        )
    suffix = suffix if suffix in SUFFIXES else ""
    # A file name has at most 255 bytes on Linux, and the table of data sets stores at most 255 characters.
    stem = name[: len(name) - len(suffix)].encode()[: MAX_NAME_BYTES - len(suffix)].decode(errors="ignore")
    return stem + suffix, compressed


def parse_fmu_name(given: str | None) -> tuple[str, bool]:
    """Return the name of an FMU, and whether it is compressed, as `parse_file_name` does.

    Raises
    ------
    ModelError
        It does not end in .fmu.
    """
    name, compressed = parse_file_name(given)
    if PurePosixPath(name).suffix.lower() != FMU_SUFFIX:
        raise ModelError(f"{name} is no FMU: send a file FILE{FMU_SUFFIX}")
    return name, compressed


def find_stored_suffix(name: str) -> str:
    """Return the suffix that the id of a data set has: its own if it is that of a format."""
    suffix = PurePosixPath(name).suffix.lower()
    return suffix if suffix in SUFFIXES else _OTHER


def receive(
    source: IO[bytes], target: IO[bytes], name: str, compressed: bool, max_bytes: int
) -> tuple[int, str]:
    """Copy a file, decompressed if necessary; return its size in bytes and its SHA-256.

    Raises
    ------
    RecordError
        The file is empty, or its name ends in .gz but it is not gzip.
    PayloadTooLargeError
        The file has more than ``max_bytes`` bytes after decompression: a small file may decompress to any
        size.
    """
    size, digest = 0, hashlib.sha256()
    stream = gzip.GzipFile(fileobj=source, mode="rb") if compressed else source
    try:
        while chunk := stream.read(CHUNK_BYTES):
            size += len(chunk)
            if size > max_bytes:
                raise PayloadTooLargeError(
                    f"{name} has more than {max_bytes / 1e6:.0f} MB after decompression, the maximum here "
                    "for a file of its size: send it uncompressed, or a part of the record"
                )
            target.write(chunk)
            digest.update(chunk)
        target.flush()
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise RecordError(
            f"{name}{GZIP_SUFFIX} is not a gzip file, or is damaged ({error}): compress the record again"
        ) from error
    if size == 0:
        raise RecordError(f"{name} is empty: export the record again")
    return size, digest.hexdigest()
