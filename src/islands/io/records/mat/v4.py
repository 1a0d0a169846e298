"""MAT-files of version 4, the format of MATLAB before 1996: matrices one after the other.

Source: MathWorks, "MAT-File Format", chapter 2.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.io.records.mat.workspace import Variable

_HEADER = 20  # bytes before a name
_TYPES = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}
_CLASSES = {0: "", 1: "char", 2: "sparse"}
_LONGEST = 256  # characters of a name: MATLAB allows 63, and what is longer is no MAT-file


@dataclass(frozen=True, slots=True, eq=False)
class _Matrix:
    """A variable, and where its numbers are."""

    name: str
    kind: str
    shape: tuple[int, int]
    dtype: np.dtype[Any]
    start: int
    stop: int


def read_variables(content: bytes) -> Iterator[Variable] | None:
    """Yield the variables of a MAT-file of version 4; None if the bytes are none.

    The iterator raises ValueError where the bytes are not as they claim.
    """
    order = next((order for order in "<>" if _matrix(content, 0, order) is not None), None)
    return None if order is None else _variables(content, order)


def _variables(content: bytes, order: str) -> Iterator[Variable]:
    start = 0
    while start < len(content):
        matrix = _matrix(content, start, order)
        if matrix is None:
            raise ValueError(f"no variable begins at byte {start}")
        if matrix.stop > len(content):
            claimed, left = matrix.stop - matrix.start, len(content) - matrix.start
            raise ValueError(f"variable {matrix.name} claims {claimed} bytes where {left} are left")
        yield Variable(matrix.name, matrix.kind, matrix.shape, partial(_numbers, content, matrix))
        start = matrix.stop


def _matrix(content: bytes, start: int, order: str) -> _Matrix | None:
    """Read the header of a variable; None where none can begin."""
    if len(content) - start < _HEADER:
        return None
    code, rows, columns, imaginary, length = struct.unpack_from(f"{order}5i", content, start)
    kind, number = _CLASSES.get(code % 10), _TYPES.get(code // 10 % 100)
    usual = code // 1000 == "<>".index(order) and imaginary in (0, 1) and 2 <= length <= _LONGEST
    if kind is None or number is None or not usual or min(rows, columns) < 0:
        return None
    begin = start + _HEADER + length
    name = content[start + _HEADER : begin].rstrip(b"\0").decode("latin-1")
    dtype = np.dtype(order + number)
    stop = begin + dtype.itemsize * rows * columns * (1 + imaginary)
    return _Matrix(name, "complex" if imaginary and not kind else kind, (rows, columns), dtype, begin, stop)


def _numbers(content: bytes, matrix: _Matrix) -> NDArray[Any]:
    rows, columns = matrix.shape
    numbers = np.frombuffer(content, matrix.dtype, rows * columns, matrix.start)
    return numbers.reshape(matrix.shape, order="F")
