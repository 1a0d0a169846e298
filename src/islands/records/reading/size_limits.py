"""Limits on declared sizes: a file's declared sizes are checked before memory is allocated for them."""

import zipfile
from collections.abc import Sized
from io import BufferedReader, FileIO
from pathlib import Path

from islands.errors import RecordError

#: Largest number of samples of a column, 1 GiB in double precision. Longer records are not used for
#: identification, and a few bytes in a file can declare any size.
MOST_SAMPLES = 2**27

#: Largest compression ratio of deflate: https://zlib.net/zlib_tech.html.
DENSEST = 1032

#: Largest number of columns of a table and of members of an archive. A small file can declare any number.
MOST_COLUMNS = 10_000

#: Largest number of cells of a sheet of a workbook, with empty ones.
MOST_CELLS = 2**26

#: Largest number of characters of a cell of text, as in Excel. A number has at most about 1100: 767 digits
#: and 323 zeros write any number in double precision exactly.
MOST_CHARACTERS = 32_767

#: Largest number of characters of the name of a column, which messages repeat.
MOST_NAME = 1000

#: Largest number of characters of a line of text: `MOST_COLUMNS` cells of 100 characters.
MOST_LINE = 1_000_000

#: Largest number of bytes of the directory of a zip archive: `MOST_COLUMNS` members with long names.
MOST_DIRECTORY = 2**21

#: Largest number of bytes of an unpacked file. Longer records are not used for identification.
MOST_UNPACKED = 2**30


class RecordArchive(zipfile.ZipFile):
    """A zip archive of bounded directory, so that a hostile one is refused before its members are listed.

    Members cannot be read beyond their declared sizes.

    Raises
    ------
    RecordError
        The archive has more than `MOST_COLUMNS` members, or a directory of more than `MOST_DIRECTORY` bytes.
    zipfile.BadZipFile, OSError, ValueError, struct.error
        The archive is damaged.
    """

    def __init__(self, path: Path) -> None:
        self._source = _DirectorySource(path)
        try:
            super().__init__(self._source)
            self._source.restricted = False
            check_column_count(self.filelist, path.name)
        except BaseException:
            self._source.close()
            raise

    def close(self) -> None:
        """Close the archive and its file."""
        super().close()
        self._source.close()


class _DirectorySource(BufferedReader):
    """File that refuses one long read: `zipfile` reads the directory of an archive by one call."""

    restricted = True

    def __init__(self, path: Path) -> None:
        super().__init__(FileIO(path))
        self._file_name = path.name

    def read(self, size: int | None = -1, /) -> bytes:
        if self.restricted and size is not None and size > MOST_DIRECTORY:
            raise _too_many_columns(self._file_name)
        return super().read(size)


def check_archive(path: Path) -> None:
    """Refuse a zip archive whose members declare more bytes than are read or than they can contain.

    Raises
    ------
    RecordError
        The archive unpacks to more than `MOST_UNPACKED` bytes, or declares an impossible size.
    """
    with RecordArchive(path) as archive:
        declared = sum(member.file_size for member in archive.filelist)
    check_unpacked(declared, path.name)
    check_stored(declared, path.stat().st_size, True, "(all)", path.name)


def check_column_count(columns: Sized, file: str) -> None:
    """Refuse a file with more than `MOST_COLUMNS` columns, variables or members.

    Raises
    ------
    RecordError
    """
    if len(columns) > MOST_COLUMNS:
        raise _too_many_columns(file)


def check_line(length: int, place: str) -> None:
    """Refuse a line of more than `MOST_LINE` characters.

    Parameters
    ----------
    length : int
        Characters of the line.
    place : str
        File and line, for the message.

    Raises
    ------
    RecordError
    """
    if length > MOST_LINE:
        raise RecordError(
            f"{place} has {length} characters, and at most {MOST_LINE} are read: write one line per sample"
        )


def check_name(name: str, place: str) -> None:
    """Refuse a name of a column with more than `MOST_NAME` characters; ``place`` is its file and line.

    Raises
    ------
    RecordError
    """
    if len(name) > MOST_NAME:
        raise RecordError(
            f"{place}: the column {name[:40]}... has a name of {len(name)} characters, and at most "
            f"{MOST_NAME} are read: give it a shorter one"
        )


def check_cell(length: int, place: str) -> None:
    """Refuse a cell of more than `MOST_CHARACTERS` characters; ``place`` is its file, line and column.

    Raises
    ------
    RecordError
    """
    if length > MOST_CHARACTERS:
        raise RecordError(
            f"{place}: the cell has {length} characters, and at most {MOST_CHARACTERS} are read: shorten it "
            "or leave the column out; is a quote never closed?"
        )


def _too_many_columns(file: str) -> RecordError:
    return RecordError(
        f"{file} has more than {MOST_COLUMNS} columns or members: save only the columns of the record"
    )


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
