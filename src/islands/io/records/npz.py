"""NumPy archives (.npz): one array per column, and the sampling time as an array of one number."""

import math
import struct
import zipfile
import zlib
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.io.records.columnar import ColumnarFile
from islands.io.records.size_limits import check_samples, check_stored

#: What NumPy and the standard library raise on damaged archives, and on Python objects in sound ones.
UNREADABLE = (ValueError, OSError, EOFError, RuntimeError, struct.error, zipfile.BadZipFile, zlib.error)

#: An array's header by its version; the third is for names in Unicode, which no array of numbers has.
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def read_archive(path: Path) -> ColumnarFile:
    """Open a NumPy archive.

    Raises
    ------
    RecordError
        The file is no archive.
    """
    if path.stat().st_size == 0:
        raise RecordError(f"{path.name} is empty: write it anew with numpy.savez")
    if not zipfile.is_zipfile(path):
        raise RecordError(f"{path.name} is not a NumPy archive: write it with numpy.savez(path, u=u, y=y)")
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.namelist()
    except UNREADABLE as error:
        raise RecordError(f"{path.name} is damaged ({error}): write it anew with numpy.savez") from error
    names = tuple(member.removesuffix(".npy") for member in members)
    return ColumnarFile(path.name, names, partial(_array, path), names)


def _array(path: Path, name: str) -> NDArray[Any]:
    try:
        with zipfile.ZipFile(path) as archive:
            member = _member(archive, name)
            with archive.open(member) as stream:
                _check_claims(stream, member, name, path)
                stream.seek(0)
                return np.asarray(npy.read_array(stream, allow_pickle=False))
    except UNREADABLE as error:
        raise RecordError(
            f"{path.name}: column {name} cannot be read ({error}): if it holds Python objects, which may run "
            "code, save it as numpy.asarray(values, float); otherwise the file is damaged, write it anew"
        ) from error


def _member(archive: zipfile.ZipFile, name: str) -> zipfile.ZipInfo:
    try:
        return archive.getinfo(f"{name}.npy")
    except KeyError:
        return archive.getinfo(name)


def _check_claims(stream: IO[bytes], member: zipfile.ZipInfo, name: str, path: Path) -> None:
    """Hold the header's shape against the member's size, and that against the bytes that pack it."""
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError("it is packed in another way than numpy.savez and numpy.savez_compressed do")
    version = npy.read_magic(stream)
    if version not in _HEADERS:
        raise ValueError(f"its format has the version {version}, which no array of numbers has")
    shape, _, dtype = _HEADERS[version](stream)
    if dtype.hasobject:  # refused by read_array; its bytes are pickled and tell no size
        return
    check_samples(math.prod(shape), name, path.name)
    values = member.file_size - stream.tell()
    check_stored(math.prod(shape) * dtype.itemsize, values, False, name, path.name)
    packed = min(member.compress_size, path.stat().st_size)
    check_stored(member.file_size, packed, member.compress_type == zipfile.ZIP_DEFLATED, name, path.name)
