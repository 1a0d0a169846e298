"""Uploads: from the bytes of a stranger to a blob and what it holds."""

import gzip
import hashlib
import zlib
from pathlib import PurePosixPath, PureWindowsPath
from typing import IO

from islands.errors import RecordError
from islands.io.records import READERS
from islands_api.web.problems import PayloadTooLargeError

#: Bytes that are handled at once.
CHUNK = 1 << 20

#: The most bytes of a file's name.
NAME = 200

#: The end of a name that says that the file is compressed.
GZIP = ".gz"


def name_of(given: str | None) -> tuple[str, bool]:
    """Return a file's own name, without any folder, and whether its bytes are compressed.

    Raises
    ------
    RecordError
        The file has no name, or one that says nothing of a format that is known.
    """
    name = PurePosixPath(PureWindowsPath(given or "").name).name
    name = "".join(each for each in name if each.isprintable()).lstrip(".")
    compressed = name.lower().endswith(GZIP)
    name = name[: -len(GZIP)] if compressed else name
    suffix = PurePosixPath(name).suffix.lower()
    if suffix not in READERS:
        known = ", ".join(READERS)
        raise RecordError(
            f"{name or 'the file'}: its name has to end in one of {known}, or in that and {GZIP}: export the "
            "record to one of these"
        )
    # A file's name has at most 255 bytes on Linux, and the table of data sets no more characters.
    stem = name[: -len(suffix)].encode()[: NAME - len(suffix)].decode(errors="ignore")
    return stem + suffix, compressed


def receive(source: IO[bytes], target: IO[bytes], name: str, compressed: bool, most: int) -> tuple[int, str]:
    """Copy a file, unpacked, to where it is kept; return its bytes' count and SHA-256.

    Raises
    ------
    RecordError
        It is empty, or no gzip though its name says so.
    PayloadTooLargeError
        It unpacks to more than ``most`` bytes: a small file may unpack to any size.
    """
    size, digest = 0, hashlib.sha256()
    stream = gzip.GzipFile(fileobj=source, mode="rb") if compressed else source
    try:
        while piece := stream.read(CHUNK):
            size += len(piece)
            if size > most:
                raise PayloadTooLargeError(
                    f"{name} has more than {most / 1e6:.0f} MB unpacked, the most that is taken here"
                )
            target.write(piece)
            digest.update(piece)
        target.flush()
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise RecordError(
            f"{name}{GZIP} is no gzip, or damaged ({error}): compress the record anew"
        ) from error
    if size == 0:
        raise RecordError(f"{name} is empty: export the record once more")
    return size, digest.hexdigest()
