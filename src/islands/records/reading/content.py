"""Format of a file by its content, for files whose name does not say it or says another one."""

import codecs
import struct
import zipfile
from collections.abc import Collection
from io import StringIO
from pathlib import Path

from islands.errors import RecordError
from islands.records.reading.formats.text.encoding import decode
from islands.records.reading.formats.text.table_start import has_samples
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.size_limits import RecordArchive

#: Bytes that decide, and bytes in which a table begins.
_SAMPLE, _LINES = 4096, 1 << 17

#: First bytes of the formats of arrays, and a suffix of the format.
_MARKS = (
    (b"\x89HDF\r\n\x1a\n", ".h5"),
    (b"MATLAB 5.0 MAT-file", ".mat"),
    (b"MATLAB 7.3 MAT-file", ".mat"),
    (b"PAR1", ".parquet"),
    (b"MDF     ", ".mf4"),
    (b"UnFinMF ", ".mf4"),
    (b"TDSm", ".tdms"),
)

#: First bytes of a zip archive, and of a workbook of Excel 97 to 2003.
_ZIP, _OLD_WORKBOOK = b"PK\x03\x04", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"

_BYTE_ORDER_MARKS = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)

#: Suffix of a text table.
TEXT = ".csv"

#: Control characters that no text contains, except for the end of a file of DOS.
_CONTROLS = bytes(set(range(32)) - set(b"\t\n\r\f\x1a"))


def find_suffix(
    path: Path, known: Collection[str], texts: Collection[str], options: ReadingOptions = DEFAULT_READING
) -> str:
    """Return the suffix of the format of a file: its own, unless it is unknown or the content contradicts it.

    Parameters
    ----------
    path : Path
    known : collection of str
        Suffixes of all formats.
    texts : collection of str
        Suffixes of text tables.
    options : ReadingOptions

    Raises
    ------
    RecordError
        The format is unknown, or is one that is not read.
    """
    suffix = path.suffix.lower()
    with path.open("rb") as stream:
        head = stream.read(_SAMPLE)
    if suffix in known and suffix not in texts:
        return TEXT if is_text(head) and _has_table(path, options) else suffix
    found = _find_mark(head) or (_find_archive(path) if head.startswith(_ZIP) else "")
    if found or suffix in texts:
        return found or suffix
    if head.startswith(_OLD_WORKBOOK):
        raise RecordError(
            f"{path.name} is a workbook of Excel 97 to 2003: open it and save it as XLSX or as CSV"
        )
    if is_text(head) and _has_table(path, options):
        return TEXT
    if head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        raise RecordError(
            f"{path.name} contains HTML or XML, not a table: open it in a spreadsheet, and save it as XLSX "
            "or CSV"
        )
    raise RecordError(
        f"{path.name}: files ending in '{path.suffix}' are not supported unless they are tables of text, "
        f"only {', '.join(known)}, also compressed as .gz or .zip: export the record to one of these"
    )


def is_text(head: bytes) -> bool:
    """Return whether the first bytes of a file are text."""
    if head.startswith(_BYTE_ORDER_MARKS):
        return True
    return bool(head.strip()) and head == head.translate(None, _CONTROLS)


def _has_table(path: Path, options: ReadingOptions) -> bool:
    """Return whether the beginning of a text has lines of numbers."""
    with path.open("rb") as stream:
        content = stream.read(_LINES)
    try:
        text, _ = decode(content, path.name)
    except RecordError:
        return False
    return has_samples(list(StringIO(text, newline=None)), options)


def _find_mark(head: bytes) -> str:
    return next((suffix for mark, suffix in _MARKS if head.startswith(mark)), "")


def _find_archive(path: Path) -> str:
    """Return the format of a zip archive that is a workbook or holds arrays; empty for another one."""
    try:
        with RecordArchive(path) as archive:
            names = archive.namelist()
    except (OSError, ValueError, NotImplementedError, struct.error, zipfile.BadZipFile):
        return ""
    if "xl/workbook.xml" in names:
        return ".xlsx"
    return ".npz" if names and all(name.endswith(".npy") for name in names) else ""
