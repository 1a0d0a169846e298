"""Limits on declared sizes: a file's declared sizes are checked before memory is allocated for them."""

import zipfile
from pathlib import Path

from islands.errors import RecordError

#: Largest number of samples of a column, 1 GiB in double precision. Longer records are not used for
#: identification, and a few bytes in a file can declare any size.
MOST_SAMPLES = 2**27

#: Largest compression ratio of deflate: https://zlib.net/zlib_tech.html.
DENSEST = 1032


#: Largest number of bytes of an unpacked file. Longer records are not used for identification.
MOST_UNPACKED = 2**30


def check_archive(path: Path) -> None:
    """Refuse a zip archive whose members declare more bytes than are read or than they can contain.

    Raises
    ------
    RecordError
        The archive unpacks to more than `MOST_UNPACKED` bytes, or declares an impossible size.
    """
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
    check_unpacked(sum(member.file_size for member in members), path.name)
    check_stored(sum(member.file_size for member in members), path.stat().st_size, True, "(all)", path.name)


def check_unpacked(size: int, file: str) -> None:
    """Refuse a file that unpacks to more than `MOST_UNPACKED` bytes.

    Raises
    ------
    RecordError
    """
    if size > MOST_UNPACKED:
        raise RecordError(
            f"{file} unpacks to more than {MOST_UNPACKED / 2**30:g} GiB: unpack it and take a part of "
            "the record"
        )


def check_samples(samples: int, column: str, file: str) -> None:
    """Refuse a column that declares more samples than a record may have.

    Raises
    ------
    RecordError
        There are more than `MOST_SAMPLES` samples.
    """
    if samples > MOST_SAMPLES:
        raise RecordError(
            f"{file}: column {column} declares {samples} samples, but a record has at most {MOST_SAMPLES}: "
            "if it really is that long, write a part of it to a separate file; otherwise the file is damaged"
        )


def check_stored(declared: int, stored: int, deflated: bool, column: str, file: str) -> None:
    """Refuse a column that declares more bytes than its stored bytes can contain.

    Parameters
    ----------
    declared, stored : int
        Declared bytes of the values, and bytes stored in the file.
    deflated : bool
        Whether the stored bytes are compressed by deflate.
    column, file : str
        Names for the message.

    Raises
    ------
    RecordError
        The declared size is impossible.
    """
    if declared > stored * (DENSEST if deflated else 1):
        raise RecordError(
            f"{file}: column {column} declares {declared} bytes, but the file stores {stored} for it"
            f"{', compressed' if deflated else ''}: it is damaged or truncated, write it again"
        )
