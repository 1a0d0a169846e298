"""What the variables of a MATLAB workspace are as columns, and what to do with those that are none."""

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
from islands.io.records.columnar import ColumnarFile
from islands.io.records.size_limits import check_samples
from islands.io.records.validation import MIN_SAMPLES

#: A matrix with up to so many columns and at least `MIN_SAMPLES` rows, or turned, holds channels.
MOST_CHANNELS = 16

#: More variables are not offered: a small file can claim any number, and in HDF5 links can form rings.
MOST_VARIABLES = 10_000

#: What readers, NumPy and h5py raise where bytes are not what they claim to be.
DAMAGED = (LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError, struct.error, zlib.error)

#: What to type in MATLAB instead of saving x, by what x is.
ADVICE = {
    "categorical": "save u = double({x})",
    "cell": "save one vector per channel, for example u = cell2mat({x})",
    "char": "save numbers, for example u = str2num({x})",
    "complex": "save a = real({x}) and b = imag({x})",
    "datetime": "save t = seconds({x} - {x}(1))",
    "duration": "save t = seconds({x})",
    "function_handle": "save the values that it returns",
    "iddata": "save u = {x}.InputData, y = {x}.OutputData and Ts = {x}.Ts",
    "link": "it points to another place, which is never followed; save the values themselves",
    "Simulink.SimulationData.Dataset": "save t = {x}{{1}}.Values.Time and y = {x}{{1}}.Values.Data",
    "Simulink.SimulationOutput": "save what it holds: t = {x}.tout, y = {x}.yout",
    "sparse": "save u = full({x})",
    "string": "save u = double({x})",
    "struct": "it is an array of structures, save each one by itself: run1 = {x}(1)",
    "table": "save s = table2struct({x}, 'ToScalar', true)",
    "timeseries": "save t = {x}.Time and y = squeeze({x}.Data)",
    "timetable": "save t = seconds({x}.Properties.RowTimes - {x}.Properties.RowTimes(1)) and its columns",
}
_OTHER = "save its numbers as one vector per channel"


@dataclass(frozen=True, slots=True, eq=False)
class Variable:
    """A variable of a workspace, or a field of a structure in it.

    Attributes
    ----------
    name : str
        ``u``, or ``run.u`` for a field.
    kind : str
        MATLAB's class where it is not one of numbers; else empty.
    shape : tuple of int
        As MATLAB counts it.
    load : callable
        The numbers, of this shape; raises one of `DAMAGED`, or `RecordError`.
    """

    name: str
    kind: str
    shape: tuple[int, ...]
    load: Callable[[], NDArray[Any]]


def make_columns(variables: Iterable[Variable], file: str) -> ColumnarFile:
    """Offer the variables as columns: a vector by its name, a matrix of a few channels as ``x_1, x_2 ...``.

    A matrix is left whole, which is no channel, where one of the new names is taken.

    Raises
    ------
    RecordError
        The file is damaged, or offers more than `MOST_VARIABLES`.
    """
    variables = _listed(variables, file)
    taken = {variable.name for variable in variables}
    names: list[str] = []
    loads: dict[str, Callable[[], NDArray[Any]]] = {}
    for variable in variables:
        load = partial(_numbers, variable, file)
        parts = [f"{variable.name}_{number + 1}" for number in range(_channels_in(variable))]
        if parts and taken.isdisjoint(parts):
            whole = lru_cache(1)(load)  # unpacked once for all its parts
            loads |= {part: partial(_part, whole, index) for index, part in enumerate(parts)}
            names += parts
        else:
            loads[variable.name] = load
            names.append(variable.name)
    # A timeseries is often called ts, and states no sampling.
    single = [variable.name for variable in variables if not variable.kind and math.prod(variable.shape) == 1]
    return ColumnarFile(file, tuple(names), lambda name: loads[name](), single)


def _listed(variables: Iterable[Variable], file: str) -> list[Variable]:
    try:
        listed = list(islice(variables, MOST_VARIABLES + 1))
    except DAMAGED as error:
        raise RecordError(f"{file} is damaged or cut short ({error}): save it anew") from error
    if len(listed) > MOST_VARIABLES:
        raise RecordError(
            f"{file} holds more than {MOST_VARIABLES} variables: save those of the record alone"
        )
    return listed


def _channels_in(variable: Variable) -> int:
    """Return how many channels stand side by side in a variable; 0 unless there are several."""
    if variable.kind or len(variable.shape) != 2:
        return 0
    count, samples = sorted(variable.shape)
    return count if 2 <= count <= MOST_CHANNELS and samples >= MIN_SAMPLES else 0


def _numbers(variable: Variable, file: str) -> NDArray[Any]:
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
            f"{file}: column {variable.name} cannot be read ({error}): the file is damaged, save it anew"
        ) from error


def _part(whole: Callable[[], NDArray[Any]], index: int) -> NDArray[Any]:
    matrix = whole()
    return matrix[:, index] if matrix.shape[0] > matrix.shape[1] else matrix[index]
