"""MAT-files of versions 5 to 7. Every declared size is checked against the available bytes.

SciPy's reader is not used: it is "not hardened for untrusted input" (github.com/scipy/scipy/pull/25166),
allocates memory for every size that it reads, terminates the process at an unknown type, and cannot list
files that contain an object. This module reads numbers and structures only, which are the smaller part of the
format.

Source: MathWorks, "MAT-File Format", chapter 1.
"""

import math
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from islands.records.reading.column_names import append_unit
from islands.records.reading.formats.mat.workspace import DAMAGED, Variable
from islands.records.reading.size_limits import DENSEST, MOST_COLUMNS, MOST_SAMPLES

_HEADER = 128  # bytes before the first element
_HEAD = 1024  # first bytes of an element, which contain class, dimensions and name of a variable
_MAX_DEPTH = 32  # nested structures

_MATRIX = 14  # element type of a variable
_COMPRESSED = 15  # element type of a compressed variable

#: Element types of characters.
_UTF8, _UTF16 = 16, 17

#: Element types of numbers, and NumPy's names for them.
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}

#: Classes of variables. Classes 6 to 15 are numbers.
_CLASSES = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 16: "function_handle"}
_OPAQUE = 17  # class of MATLAB's own objects
_COMPLEX = 0x800  # flag in the same word as the class


@dataclass(frozen=True, slots=True, eq=False)
class _Span:
    """A range of bytes of the file or of a decompressed element."""

    content: bytes
    order: str
    start: int
    stop: int

    def numbers(self, kind: str) -> NDArray[Any]:
        dtype = np.dtype(self.order + kind)
        count = (self.stop - self.start) // dtype.itemsize
        return np.frombuffer(self.content, dtype, count, self.start)

    def text(self) -> str:
        return self.content[self.start : self.stop].decode("latin-1")


@dataclass(frozen=True, slots=True, eq=False)
class _Matrix:
    """Header of a variable, and the elements that follow it."""

    name: str
    kind: str
    shape: tuple[int, ...]
    parts: Iterator[tuple[int, _Span]]


def read_variables(content: bytes) -> Iterator[Variable] | None:
    """Yield the variables and structure fields of a MAT-file of versions 5 to 7.

    Return None if the file has another format. The iterator raises one of
    `islands.records.reading.formats.mat.workspace.DAMAGED` if the bytes are damaged.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    return None if order is None else _iterate_variables(_Span(content, order, _HEADER, len(content)))


def _iterate_variables(file: _Span) -> Iterator[Variable]:
    for kind, span in _iterate_elements(file):
        if kind == _COMPRESSED:
            compressed = file.content[span.start : span.stop]
            head = zlib.decompressobj().decompress(compressed, _HEAD)
            matrix, load = (
                _read_header(_Span(head, file.order, 8, len(head))),
                partial(_decompress, compressed, file.order),
            )
        else:
            matrix, load = _read_header(span), partial(_identity, span)
        if not matrix.name or matrix.name.startswith("__"):  # internal to MATLAB: the contents of objects
            continue
        try:
            yield from list(_flatten(matrix.name, matrix, load, 0))
        except DAMAGED as error:  # a damaged structure does not prevent reading other variables
            yield Variable(matrix.name, "", matrix.shape, partial(_raise, error))


def _flatten(name: str, matrix: _Matrix, load: Callable[[], _Span], depth: int) -> Iterator[Variable]:
    """Yield a variable, or the fields of a structure."""
    if matrix.kind != "struct" or not math.prod(matrix.shape):
        yield Variable(name, matrix.kind, matrix.shape, partial(_read_numbers, load))
        return
    if depth > _MAX_DEPTH:
        raise ValueError(f"structures are nested more than {_MAX_DEPTH} deep")
    parts = _read_header(load()).parts
    width = int(_next(parts).numbers("i4")[0])
    table = _next(parts).text()
    if len(table) > width * MOST_COLUMNS:
        raise ValueError(f"a structure has more than {MOST_COLUMNS} fields")
    fields = [table[start : start + width].partition("\0")[0] for start in range(0, len(table), width)]
    if {"Name", "Data"} <= set(fields):
        yield from _list_channels(name, fields, [span for _, span in parts])
        return
    if matrix.shape != (1, 1):
        yield Variable(name, matrix.kind, matrix.shape, partial(_read_numbers, load))
        return
    for field, (_, span) in zip(fields, parts, strict=True):
        yield from _flatten(f"{name}.{field}", _read_header(span), partial(_identity, span), depth + 1)


def _list_channels(name: str, fields: list[str], spans: list[_Span]) -> Iterator[Variable]:
    """Yield the channels of an array of structures that have a name and data each.

    dSPACE ControlDesk writes a capture as a structure of the time axis ``X`` and the channels ``Y``, which
    have the paths of their blocks as names.
    """
    capture, _, axis = name.rpartition(".")
    seen: dict[str, int] = {}
    for start in range(0, len(spans), len(fields)):
        element = dict(zip(fields, spans[start : start + len(fields)], strict=True))
        label = "time" if axis == "X" else _read_text(element["Name"]).replace('"', "").replace(".", "/")
        label = append_unit(label, _read_text(element["Unit"]) if "Unit" in element else "")
        seen[label] = seen.get(label, 0) + 1
        label += f" ({seen[label]})" if seen[label] > 1 else ""
        data = _read_header(element["Data"])
        load = partial(_read_numbers, partial(_identity, element["Data"]))
        yield Variable(f"{capture or axis}.{label}", data.kind, data.shape, load)


def _read_text(span: _Span) -> str:
    """Return the text of a variable of characters, empty for another one."""
    matrix = _read_header(span)
    kind, characters = next(matrix.parts, (0, None))
    if matrix.kind != "char" or characters is None:
        return ""
    order = "le" if span.order == "<" else "be"
    coding = {_UTF8: "utf-8", _UTF16: f"utf-16-{order}", 4: f"utf-16-{order}"}.get(kind, "latin-1")
    return span.content[characters.start : characters.stop].decode(coding, "replace")


def _read_numbers(load: Callable[[], _Span]) -> NDArray[Any]:
    matrix = _read_header(load())
    if not math.prod(matrix.shape):
        return np.empty(matrix.shape)
    kind, span = next(matrix.parts, (0, None))
    if span is None or kind not in _TYPES:
        raise ValueError(f"its numbers have the unknown type {kind}")
    numbers = span.numbers(_TYPES[kind])
    if numbers.size != math.prod(matrix.shape):
        raise ValueError(f"it declares the shape {matrix.shape} but has {numbers.size} numbers")
    return numbers.reshape(matrix.shape, order="F")


def _decompress(compressed: bytes, order: str) -> _Span:
    stream = zlib.decompressobj()
    _, size = struct.unpack(f"{order}2I", stream.decompress(compressed, 8))
    if size > min(DENSEST * len(compressed), 8 * MOST_SAMPLES):
        raise ValueError(f"it declares {size} bytes, compressed to {len(compressed)}")
    content = stream.decompress(stream.unconsumed_tail, size) if size else b""
    # Reading up to the end also verifies the checksum.
    if len(content) < size or stream.decompress(stream.unconsumed_tail, 1):
        raise ValueError(f"it declares {size} bytes but contains a different number")
    return _Span(content, order, 0, size)


def _identity(span: _Span) -> _Span:
    return span


def _raise(error: Exception) -> NoReturn:
    raise error


def _read_header(span: _Span) -> _Matrix:
    """Read the header of a variable. The bytes after the header need not be available yet."""
    parts = _iterate_elements(span)
    if span.start == span.stop:  # an empty field may have no bytes
        return _Matrix("", "", (0, 0), parts)
    flags = int(_next(parts).numbers("u4")[0])
    code = flags & 0xFF
    if code == _OPAQUE:
        name, _, kind = _next(parts).text(), _next(parts), _next(parts).text()
        return _Matrix(name, kind, (), parts)
    shape = tuple(_next(parts).numbers("i4").tolist())
    if len(shape) < 2 or min(shape) < 0:
        raise ValueError(f"an array has the dimensions {shape}")
    name, kind = _next(parts).text(), _CLASSES.get(code, "complex" if flags & _COMPLEX else "")
    return _Matrix(name, _next(parts).text() if kind == "object" else kind, shape, parts)


def _next(parts: Iterator[tuple[int, _Span]]) -> _Span:
    _, span = next(parts, (0, None))
    if span is None:
        raise ValueError("an array ends before its values begin")
    return span


def _iterate_elements(outer: _Span) -> Iterator[tuple[int, _Span]]:
    """Yield the type and the byte range of every element."""
    start = outer.start
    while start < outer.stop:
        kind, size = struct.unpack_from(f"{outer.order}2I", outer.content, start)
        body, padding = start + 8, 0 if kind in (_MATRIX, _COMPRESSED) else -size % 8
        if kind >> 16:  # a short element: type and size share four bytes, the values are in the other four
            kind, size, body = kind & 0xFFFF, kind >> 16, start + 4
            padding = 4 - size
        if body + size > outer.stop or padding < 0:
            raise ValueError(f"an element declares {size} bytes but {outer.stop - body} are left")
        yield kind, _Span(outer.content, outer.order, body, body + size)
        start = body + size + padding
