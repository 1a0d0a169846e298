"""MAT-files of version 4, the format of MATLAB before 1996: a sequence of matrices.

Source: MathWorks, "MAT-File Format", chapter 2.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.records.reading.formats.mat.workspace import Variable

_HEADER = 20  # bytes before the name
_TYPES = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}
_CLASSES = {0: "", 1: "char", 2: "sparse"}
_LONGEST = 256  # characters of a name; MATLAB allows 63, so that longer names mean another format


@dataclass(frozen=True, slots=True, eq=False)
class _Matrix:
    """Header of a variable, and the position of its numbers."""

    name: str
    kind: str
    shape: tuple[int, int]
    dtype: np.dtype[Any]
    start: int
    stop: int


def read_variables(content: bytes) -> Iterator[Variable] | None:
    """Yield the variables of a MAT-file of version 4; return None if the bytes have another format.

    The iterator raises ValueError if the bytes are damaged.
    """
    order = next((order for order in "<>" if _read_header(content, 0, order) is not None), None)
    return None if order is None else _iterate_variables(content, order)


def _iterate_variables(content: bytes, order: str) -> Iterator[Variable]:
    start = 0
    while start < len(content):
        matrix = _read_header(content, start, order)
        if matrix is None:
            raise ValueError(f"no variable begins at byte {start}")
        if matrix.stop > len(content):
            declared, left = matrix.stop - matrix.start, len(content) - matrix.start
            raise ValueError(f"variable {matrix.name} declares {declared} bytes but {left} are left")
        yield Variable(matrix.name, matrix.kind, matrix.shape, partial(_read_numbers, content, matrix))
        start = matrix.stop


def _read_header(content: bytes, start: int, order: str) -> _Matrix | None:
    """Read the header of a variable; return None if no valid header begins there."""
    if len(content) - start < _HEADER:
        return None
    code, rows, columns, imaginary, length = struct.unpack_from(f"{order}5i", content, start)
    kind, number = _CLASSES.get(code % 10), _TYPES.get(code // 10 % 100)
    valid = code // 1000 == "<>".index(order) and imaginary in (0, 1) and 2 <= length <= _LONGEST
    if kind is None or number is None or not valid or min(rows, columns) < 0:
        return None
    begin = start + _HEADER + length
    name = content[start + _HEADER : begin].rstrip(b"\0").decode("latin-1")
    dtype = np.dtype(order + number)
    stop = begin + dtype.itemsize * rows * columns * (1 + imaginary)
    return _Matrix(name, "complex" if imaginary and not kind else kind, (rows, columns), dtype, begin, stop)


def _read_numbers(content: bytes, matrix: _Matrix) -> NDArray[Any]:
    rows, columns = matrix.shape
    numbers = np.frombuffer(content, matrix.dtype, rows * columns, matrix.start)
    return numbers.reshape(matrix.shape, order="F")
