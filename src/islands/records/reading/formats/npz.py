"""NumPy archives (.npz): one array per column; the sampling time may be an array of one number."""

import math
import struct
import tokenize
import weakref
import zipfile
import zlib
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.records.reading.formats.columnar import ColumnarFile
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.size_limits import RecordArchive, check_samples, check_stored, check_unpacked

#: Exceptions that NumPy and the standard library raise for damaged archives and for Python objects in valid
#: ones.
UNREADABLE = (
    *(ValueError, OSError, EOFError, RuntimeError, SyntaxError),
    *(struct.error, tokenize.TokenError, zipfile.BadZipFile, zlib.error),
)

#: Readers of an array's header by format version. Version 3 is for Unicode field names, which arrays of
#: numbers do not have.
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def read_archive(path: Path, options: ReadingOptions = DEFAULT_READING) -> ColumnarFile:
    """Open a NumPy archive.

    Raises
    ------
    RecordError
        The file is not a NumPy archive, is empty or is damaged.
    """
    options.check_array_file(path.name)
    if path.stat().st_size == 0:
        raise RecordError(f"{path.name} is empty: write it again with numpy.savez")
    if not zipfile.is_zipfile(path):
        raise RecordError(f"{path.name} is not a NumPy archive: write it with numpy.savez(path, u=u, y=y)")
    try:
        archive = RecordArchive(path)
    except UNREADABLE as error:
        raise RecordError(f"{path.name} is damaged ({error}): write it again with numpy.savez") from error
    # Members that are not compressed need as many bytes in the file as they declare.
    packed = [member for member in archive.filelist if member.compress_type != zipfile.ZIP_STORED]
    check_unpacked(sum(member.file_size for member in packed), path.name)
    names = tuple(member.removesuffix(".npy") for member in archive.namelist())
    table = ColumnarFile(
        path.name, names, partial(_load_array, archive, path), names, missing=options.missing
    )
    # Opening an archive reads its whole directory, so that it is opened once for all columns.
    weakref.finalize(table, archive.close)
    return table


def _load_array(archive: zipfile.ZipFile, path: Path, name: str) -> NDArray[Any]:
    try:
        member = _find_member(archive, name)
        with archive.open(member) as stream:
            _check_declared_size(stream, member, name, path)
            stream.seek(0)
            return np.asarray(npy.read_array(stream, allow_pickle=False))
    except UNREADABLE as error:
        raise RecordError(
            f"{path.name}: column {name} cannot be read ({error}): if it holds Python objects, which may run "
            "code, save it as numpy.asarray(values, float); otherwise the file is damaged, write it again"
        ) from error


def _find_member(archive: zipfile.ZipFile, name: str) -> zipfile.ZipInfo:
    try:
        return archive.getinfo(f"{name}.npy")
    except KeyError:
        return archive.getinfo(name)


def _check_declared_size(stream: IO[bytes], member: zipfile.ZipInfo, name: str, path: Path) -> None:
    """Check the shape in the header against the member's size, and that size against the compressed bytes."""
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError("its compression method is not used by numpy.savez or numpy.savez_compressed")
    version = npy.read_magic(stream)
    if version not in _HEADERS:
        raise ValueError(f"its format version {version} is not used for arrays of numbers")
    shape, _, dtype = _HEADERS[version](stream)
    if dtype.hasobject:  # read_array refuses it; the size of pickled objects does not follow from the shape
        return
    check_samples(math.prod(shape), name, path.name)
    values = member.file_size - stream.tell()
    check_stored(math.prod(shape) * dtype.itemsize, values, False, name, path.name)
    packed = min(member.compress_size, path.stat().st_size)
    check_stored(member.file_size, packed, member.compress_type == zipfile.ZIP_DEFLATED, name, path.name)
