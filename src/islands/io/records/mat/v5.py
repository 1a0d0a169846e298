"""MAT-files of version 5 to 7: their variables, every size in which is held against the bytes that are there.

Not by SciPy's reader: it is "not hardened for untrusted input" (github.com/scipy/scipy/pull/25166), takes
memory for every size that it reads, ends the process at a type that it does not know, and lists no file that
holds an object. Numbers and structures are read here, which is the smaller part of the format. Its source:
MathWorks, "MAT-File Format", chapter 1.
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

from islands.io.records.mat.workspace import DAMAGED, Variable
from islands.io.records.size_limits import DENSEST, MOST_SAMPLES

_HEADER = 128  # bytes before the first element
_HEAD = 1024  # bytes of an element in which class, dimensions and name of a variable stand
_DEEPEST = 32  # structures in one another

#: Types of elements; of those with numbers also NumPy's names.
_MATRIX, _COMPRESSED = 14, 15
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}

#: Classes of variables; those of numbers are 6 to 15.
_CLASSES = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 16: "function_handle"}
_OPAQUE = 17
_COMPLEX = 0x800  # a flag beside the class


@dataclass(frozen=True, slots=True, eq=False)
class _Span:
    """A part of the file, or of what was packed in it."""

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
    """What a variable announces, and the elements behind that."""

    name: str
    kind: str
    shape: tuple[int, ...]
    parts: Iterator[tuple[int, _Span]]


def read_variables(content: bytes) -> Iterator[Variable] | None:
    """Yield the variables of a MAT-file of version 5 to 7 and the fields of structures; None if it is none.

    The iterator raises one of `islands.io.records.mat.workspace.DAMAGED` if the bytes are damaged.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    return None if order is None else _variables(_Span(content, order, _HEADER, len(content)))


def _variables(file: _Span) -> Iterator[Variable]:
    for kind, span in _elements(file):
        if kind == _COMPRESSED:
            packed = file.content[span.start : span.stop]
            head = zlib.decompressobj().decompress(packed, _HEAD)
            matrix, load = (
                _matrix(_Span(head, file.order, 8, len(head))),
                partial(_inflated, packed, file.order),
            )
        else:
            matrix, load = _matrix(span), partial(_itself, span)
        if not matrix.name or matrix.name.startswith("__"):  # MATLAB's own: the contents of objects
            continue
        try:
            yield from list(_offered(matrix.name, matrix, load, 0))
        except DAMAGED as error:  # of a structure; it does no harm to who asks for others
            yield Variable(matrix.name, "", matrix.shape, partial(_refuse, error))


def _offered(name: str, matrix: _Matrix, load: Callable[[], _Span], depth: int) -> Iterator[Variable]:
    """Yield a variable, or what the fields of a structure hold."""
    if matrix.kind != "struct" or matrix.shape != (1, 1):
        yield Variable(name, matrix.kind, matrix.shape, partial(_numbers, load))
        return
    if depth > _DEEPEST:
        raise ValueError(f"structures stand in one another more than {_DEEPEST} deep")
    parts = _matrix(load()).parts
    width = int(_next(parts).numbers("i4")[0])
    table = _next(parts).text()
    fields = [table[start : start + width].partition("\0")[0] for start in range(0, len(table), width)]
    for field, (_, span) in zip(fields, parts, strict=True):
        yield from _offered(f"{name}.{field}", _matrix(span), partial(_itself, span), depth + 1)


def _numbers(load: Callable[[], _Span]) -> NDArray[Any]:
    matrix = _matrix(load())
    if not math.prod(matrix.shape):
        return np.empty(matrix.shape)
    kind, span = next(matrix.parts, (0, None))
    if span is None or kind not in _TYPES:
        raise ValueError(f"its numbers are of the unknown type {kind}")
    numbers = span.numbers(_TYPES[kind])
    if numbers.size != math.prod(matrix.shape):
        raise ValueError(f"it claims the shape {matrix.shape} and holds {numbers.size} numbers")
    return numbers.reshape(matrix.shape, order="F")


def _inflated(packed: bytes, order: str) -> _Span:
    stream = zlib.decompressobj()
    _, size = struct.unpack(f"{order}2I", stream.decompress(packed, 8))
    if size > min(DENSEST * len(packed), 8 * MOST_SAMPLES):
        raise ValueError(f"it claims {size} bytes, packed in {len(packed)}")
    content = stream.decompress(stream.unconsumed_tail, size) if size else b""
    if len(content) < size or stream.decompress(stream.unconsumed_tail, 1):  # its end tells the checksum
        raise ValueError(f"it claims {size} bytes, and as many are not packed")
    return _Span(content, order, 0, size)


def _itself(span: _Span) -> _Span:
    return span


def _refuse(error: Exception) -> NoReturn:
    raise error


def _matrix(span: _Span) -> _Matrix:
    """Read what a variable announces; nothing behind that need be there yet."""
    parts = _elements(span)
    if span.start == span.stop:  # an empty field may have no bytes at all
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


def _elements(outer: _Span) -> Iterator[tuple[int, _Span]]:
    """Yield type and place of every element, one after the other."""
    start = outer.start
    while start < outer.stop:
        kind, size = struct.unpack_from(f"{outer.order}2I", outer.content, start)
        body, padding = start + 8, 0 if kind in (_MATRIX, _COMPRESSED) else -size % 8
        if kind >> 16:  # a short element: type and size share four bytes, the values are in the other four
            kind, size, body = kind & 0xFFFF, kind >> 16, start + 4
            padding = 4 - size
        if body + size > outer.stop or padding < 0:
            raise ValueError(f"an element claims {size} bytes where {outer.stop - body} are left")
        yield kind, _Span(outer.content, outer.order, body, body + size)
        start = body + size + padding
