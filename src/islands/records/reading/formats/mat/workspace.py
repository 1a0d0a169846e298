"""Conversion of the variables of a MATLAB workspace to columns, and advice for unsupported classes."""

import math
import struct
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import islice
from typing import Any

from numpy.typing import NDArray

from islands.errors import RecordError
from islands.records.reading.formats.columnar import ColumnarFile
from islands.records.reading.size_limits import MOST_COLUMNS, check_column_count, check_samples
from islands.records.reading.validation import MIN_SAMPLES

#: Largest number of channels in a matrix. The other dimension must be at least `MIN_SAMPLES`.
MOST_CHANNELS = 16

#: Exceptions that readers, NumPy and h5py raise for damaged files.
DAMAGED = (
    *(ArithmeticError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError),
    *(struct.error, zlib.error),
)

#: MATLAB commands to save a variable x as numbers, by its class.
ADVICE = {
    "categorical": "save u = double({x})",
    "cell": "save one vector per channel, for example u = cell2mat({x})",
    "char": "save numbers, for example u = str2num({x})",
    "complex": "save a = real({x}) and b = imag({x})",
    "datetime": "save t = seconds({x} - {x}(1))",
    "duration": "save t = seconds({x})",
    "function_handle": "save the values that it returns",
    "iddata": "save u = {x}.InputData, y = {x}.OutputData and Ts = {x}.Ts",
    "link": "it refers to another place, and references are never followed; save the values themselves",
    "Simulink.SimulationData.Dataset": "save t = {x}{{1}}.Values.Time and y = {x}{{1}}.Values.Data",
    "Simulink.SimulationOutput": "save its contents: t = {x}.tout, y = {x}.yout",
    "sparse": "save u = full({x})",
    "string": "save u = double({x})",
    "struct": "it is an array of structures, save each one separately: run1 = {x}(1)",
    "table": "save s = table2struct({x}, 'ToScalar', true)",
    "timeseries": "save t = {x}.Time and y = squeeze({x}.Data)",
    "timetable": "save t = seconds({x}.Properties.RowTimes - {x}.Properties.RowTimes(1)) and its columns",
}
_OTHER = "save its numbers as one vector per channel"


@dataclass(frozen=True, slots=True, eq=False)
class Variable:
    """A variable of a workspace, or a field of a structure.

    Attributes
    ----------
    name : str
        ``u``, or ``run.u`` for a field.
    kind : str
        MATLAB class if it is not a class of numbers; otherwise empty.
    shape : tuple of int
        Shape in MATLAB's order of axes.
    load : callable
        Returns the numbers in this shape; raises one of `DAMAGED`, or `RecordError`.
    """

    name: str
    kind: str
    shape: tuple[int, ...]
    load: Callable[[], NDArray[Any]]


def make_columns(variables: Iterable[Variable], file: str, missing: tuple[str, ...] = ()) -> ColumnarFile:
    """Convert variables to columns.

    A vector keeps its name; a matrix of a few channels becomes ``x_1, x_2 ...``. A matrix is not split if one
    of the new names is taken; it is then not usable as a channel. ``missing`` are the words and numbers that
    mean a missing value.

    Raises
    ------
    RecordError
        The file is damaged, or has more than `MOST_COLUMNS` variables.
    """
    variables = _list_variables(variables, file)
    taken = {variable.name for variable in variables}
    names: list[str] = []
    loads: dict[str, Callable[[], NDArray[Any]]] = {}
    for variable in variables:
        load = partial(_load_numbers, variable, file)
        parts = [f"{variable.name}_{number + 1}" for number in range(_count_channels(variable))]
        if parts and taken.isdisjoint(parts):
            load_matrix = lru_cache(1)(load)  # decompressed once for all channels
            loads |= {part: partial(_load_channel, load_matrix, index) for index, part in enumerate(parts)}
            names += parts
        else:
            loads[variable.name] = load
            names.append(variable.name)
    # Numbers only: a timeseries object is often called ts but does not state the sampling time.
    single = [variable.name for variable in variables if not variable.kind and math.prod(variable.shape) == 1]
    return ColumnarFile(file, tuple(names), lambda name: loads[name](), single, missing=missing)


def _list_variables(variables: Iterable[Variable], file: str) -> list[Variable]:
    try:
        listed = list(islice(variables, MOST_COLUMNS + 1))
    except DAMAGED as error:
        raise RecordError(f"{file} is damaged or truncated ({error}): save it again") from error
    check_column_count(listed, file)
    return listed


def _count_channels(variable: Variable) -> int:
    """Return the number of channels of a matrix; 0 if the variable is not a matrix of channels."""
    if variable.kind or len(variable.shape) != 2:
        return 0
    count, samples = sorted(variable.shape)
    return count if 2 <= count <= MOST_CHANNELS and samples >= MIN_SAMPLES else 0


def _load_numbers(variable: Variable, file: str) -> NDArray[Any]:
    if variable.kind:
        raise RecordError(
            f"{file}: column {variable.name} holds {variable.kind} where real numbers are expected: "
            f"{ADVICE.get(variable.kind, _OTHER).format(x=variable.name)}"
        )
    check_samples(math.prod(variable.shape), variable.name, file)
    try:
        return variable.load()
    except DAMAGED as error:
        raise RecordError(
            f"{file}: column {variable.name} cannot be read ({error}): the file is damaged, save it again"
        ) from error


def _load_channel(load_matrix: Callable[[], NDArray[Any]], index: int) -> NDArray[Any]:
    matrix = load_matrix()
    return matrix[:, index] if matrix.shape[0] > matrix.shape[1] else matrix[index]
