"""Records from data in memory: pandas and polars frames, xarray data sets, mappings and arrays.

Columns of frames pass the checks of a file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import RecordError, SettingsError
from islands.records.coupled import AnyRecord, CoupledRecord, couple, join_columns
from islands.records.dataset import Dataset, join
from islands.records.masked_values import fill_masked
from islands.records.reading.column_names import (
    find_column,
    list_inputs,
    looks_like_time,
    seconds_per_unit,
    take_outputs,
)
from islands.records.reading.formats.columnar import ColumnarFile
from islands.records.reading.memory_columns import MemoryColumns, read_columns_in_memory
from islands.records.reading.open_table import read_table
from islands.records.reading.options import DEFAULT_READING, ROWS, ReadingOptions, take_reading

if TYPE_CHECKING:
    import xarray
    from narwhals.typing import IntoDataFrame, IntoSeries

    #: Data with named columns.
    FrameLike: TypeAlias = IntoDataFrame | xarray.Dataset | Mapping[str, ArrayLike]

    #: What a record can be made of.
    RecordLike: TypeAlias = AnyRecord | FrameLike | IntoSeries | ArrayLike | Sequence[Dataset | FrameLike]

#: Options of reading, or a mapping of their names to values.
ReadingLike: TypeAlias = ReadingOptions | Mapping[str, Any]

#: Name of the data in messages.
_TITLE = "the record"


def as_record(
    data: "RecordLike",
    y: "ArrayLike | IntoSeries | None" = None,
    dt: float | None = None,
    *,
    inputs: str | Sequence[str] = (),
    output: str | Sequence[str] | None = None,
    missing_output: bool = False,
    resting_inputs: bool = False,
    signals: Sequence[str] = (),
    **options: Any,
) -> AnyRecord:
    """Make a record of a data frame or of arrays, and check it as `read_record` checks a file.

    Parameters
    ----------
    data : record, data frame, xarray Dataset or DataArray, mapping, array, or list of them
        Columns by name (pandas, polars or another frame that narwhals reads, xarray, or a mapping of names to
        arrays); or the inputs alone, of shape (samples,) or (samples, inputs), if ``y`` is given. A record is
        returned as it is. A list of frames or of Datasets is one record of several recordings.
    y : array, optional
        The output, of shape (samples,), or several, of shape (samples, outputs).
    dt : float, optional
        Sampling time in seconds. It may be left out if the data have a time: an index of times or of
        fractions of a second, the time coordinate of xarray data, or a column that `read_record` would take
        as the time.
    inputs : str or sequence of str
        Names of the input columns, in the order of the model's inputs; ``u_V+1`` reads the column u_V one
        sample early.
    output : str or sequence of str
        Name of the output column, or names of several.
    missing_output : bool
        Accept missing values of the output, also of a whole output that is not named, and constant columns,
        for a simulation.
    resting_inputs : bool
        Accept constant inputs, for a diagnosis.
    signals : sequence of str
        Inputs that are read at the samples of an output with fewer samples, such as the output of a
        simulation; others may be averaged from each sample to the next.
    **options
        Options of `read_record` that are not for text: ``time``, ``time_unit``, ``resample``, ``missing``,
        ``gaps``, ``outliers`` and ``rates``.

    Returns
    -------
    Dataset or CoupledRecord
        A record of several outputs is a `CoupledRecord`.

    Raises
    ------
    RecordError
        A column does not exist (the message lists them), has missing values or is constant, the time is not
        uniform, or an output is given twice or is also an input.
    SettingsError
        The arguments do not describe a record.
    """
    _check_kinds(data, y)
    outputs = take_outputs(output)
    inputs = inputs if isinstance(inputs, str) else list_inputs(inputs)
    reading = take_reading(options)
    reading.check_array_file(_TITLE, zones=False)
    if isinstance(data, Dataset | CoupledRecord):
        if y is not None or dt is not None or inputs or outputs or options:
            raise SettingsError(
                f"a {type(data).__name__} already has its inputs, outputs and sampling time: give nothing "
                "else"
            )
        return data
    if y is None and isinstance(data, list | tuple) and data and _is_recording(data[0]):
        accepted = {
            **options,
            "missing_output": missing_output,
            "resting_inputs": resting_inputs,
            "signals": signals,
        }
        inputs, first = join_columns(list_inputs(inputs), outputs)
        made = (_read_one(each, dt, inputs, first, accepted) for each in data)
        return couple(join(tuple(made)), len(outputs))
    columns = read_columns_in_memory(data)
    if y is not None:
        if inputs or outputs:
            raise SettingsError(
                "inputs and output name columns of a data frame: leave them out with two arrays"
            )
        inputs, outputs, columns = _join_outputs(data, columns, y)
    elif columns is None:
        raise SettingsError(
            "an array holds the inputs only: give the output and the sampling time as well, (u, y, dt)"
        )
    inputs, first = join_columns(list_inputs(inputs), outputs)
    table = _make_table(columns, (*inputs, first), reading)
    if first is None and not missing_output:
        raise SettingsError(
            f"no output is given: take one of the columns {', '.join(table.names)} as output=..."
        )
    if y is not None and reading.rates is None:
        # The elements of arrays are samples; a column of a frame may have its own clock.
        reading = replace(reading, rates=ROWS)
    record = read_table(
        *(table, _TITLE, inputs, first, dt),
        missing_output=missing_output,
        options=reading,
        resting_inputs=resting_inputs,
        signals=signals,
    )
    if first is None:
        return record
    names = [*record.input_names, first]
    units = [
        columns.units.get(find_column(name, table.names)) or unit
        for name, unit in zip(names, (*record.input_units, record.output_unit), strict=True)
    ]
    record = replace(record, input_units=tuple(units[:-1]), output_unit=units[-1])
    return couple(record, len(outputs))


def as_dataset(
    data: "RecordLike",
    y: "ArrayLike | IntoSeries | None" = None,
    dt: float | None = None,
    *,
    inputs: str | Sequence[str] = (),
    output: str | Sequence[str] | None = None,
    **options: Any,
) -> Dataset:
    """Make a record of one output as `as_record` does.

    Raises
    ------
    RecordError, SettingsError
        As in `as_record`; or there are several outputs.
    """
    record = as_record(data, y, dt, inputs=inputs, output=output, **options)
    if isinstance(record, CoupledRecord):
        raise SettingsError(f"one output is needed, got {', '.join(record.output_names)}: name one of them")
    return record


def _check_kinds(data: Any, y: Any) -> None:
    if data is None:
        raise SettingsError("no record is given: give a data frame, a Dataset, or the arrays u and y")
    if isinstance(y, str):
        raise SettingsError("name the columns of a data frame: inputs=..., output=...")
    if isinstance(data, str | Path):
        raise SettingsError(f"a file is read by islands.read_record({str(data)!r}, inputs=..., output=...)")
    if isinstance(y, Dataset | float):
        raise SettingsError("the second argument is the output: give validation data as validation=...")


def _is_recording(data: Any) -> bool:
    return isinstance(data, Dataset) or read_columns_in_memory(data) is not None


def _read_one(
    data: Any,
    dt: float | None,
    inputs: Sequence[str],
    output: str | None,
    accepted: Mapping[str, Any],
) -> Dataset:
    if isinstance(data, Dataset):
        return data
    return as_dataset(data, dt=dt, inputs=inputs, output=output, **accepted)


def column_names(data: "RecordLike") -> tuple[str, ...]:
    """Return the names of the columns of data in memory; empty for arrays."""
    columns = None if isinstance(data, Dataset) else read_columns_in_memory(data)
    return () if columns is None else tuple(columns.load)


def states_time(data: "RecordLike", taken: Sequence[str] = ()) -> bool:
    """Return whether data with named columns have a time besides the columns that are taken."""
    columns = read_columns_in_memory(data)
    return columns is not None and bool(columns.time or _time_columns(columns, taken))


def read_data(
    data: "RecordLike",
    y: "ArrayLike | IntoSeries | None",
    dt: float | None,
    inputs: str | Sequence[str],
    output: str | Sequence[str] | None,
    validation: "RecordLike | float",
    reading: ReadingLike = DEFAULT_READING,
) -> tuple[AnyRecord, AnyRecord | float]:
    """Return the record of a search, and its validation data with the same columns or their fraction."""
    options = take_reading(reading).changes()
    record = as_record(data, y, dt, inputs=inputs, output=output, **options)
    if validation is None or isinstance(validation, str | slice):
        raise SettingsError(
            f"validation is a fraction such as 0.25, or a record, got {validation!r}: cut rows by "
            "record[start:stop]"
        )
    if isinstance(validation, Dataset | CoupledRecord | Real):
        return record, cast("AnyRecord | float", validation)
    columns = inputs or record.input_names
    held_out = as_record(validation, dt=dt, inputs=columns, output=output or record.output_names, **options)
    return record, held_out


def _join_outputs(
    data: Any, columns: MemoryColumns | None, y: Any
) -> tuple[tuple[str, ...], tuple[str, ...], MemoryColumns]:
    """Return the names of the inputs and of the outputs, and the columns of both."""
    if columns is None:
        u = _to_array(data, "inputs")
        if not u.ndim:
            raise SettingsError(f"the inputs are an array of numbers, got {type(data).__name__}")
        if u.ndim > 2:
            raise SettingsError(
                f"the inputs are an array of the shape (samples,) or (samples, inputs), got {u.shape}"
            )
        samples = (np.shape(y) or (1,))[0]
        if u.ndim == 2 and len(u) != samples == u.shape[1]:
            raise RecordError(
                f"the inputs have the shape {u.shape}, the output {samples} samples: rows are samples, "
                "give the transpose (u.T)"
            )
        names = ("u",) if u.ndim < 2 else tuple(f"u{place + 1}" for place in range(u.shape[1]))
        channels = u[:, None].T if u.ndim < 2 else u.T
        columns = MemoryColumns(
            {name: partial(np.asarray, channel) for name, channel in zip(names, channels, strict=True)}
        )
    loads = {name or "u": load for name, load in columns.load.items()}
    other = read_columns_in_memory(y) or _read_output_array(y)
    outputs = {
        name if name and name not in loads else _number_output(place, len(other.load)): load
        for place, (name, load) in enumerate(other.load.items(), start=1)
    }
    return tuple(loads), tuple(outputs), MemoryColumns(loads | outputs, columns.time or other.time)


def _read_output_array(y: Any) -> MemoryColumns:
    """Return the columns of an array of one output, or of several, of the shape (samples, outputs)."""
    values = _to_array(y, "output")
    if values.ndim < 2 or 1 in values.shape:
        return MemoryColumns({"": lambda: values})
    if values.ndim > 2 or values.shape[0] < values.shape[1]:
        raise RecordError(
            f"outputs are an array of the shape (samples, outputs), got {values.shape}: rows are samples"
        )
    columns = {_number_output(place, len(values.T)): column for place, column in enumerate(values.T, start=1)}
    return MemoryColumns({name: partial(np.asarray, column) for name, column in columns.items()})


def _number_output(place: int, outputs: int) -> str:
    return "y" if outputs == 1 else f"y{place}"


def _to_array(data: Any, name: str) -> NDArray[Any]:
    try:
        return np.asarray(fill_masked(data))
    except ValueError as error:
        raise RecordError(f"the {name} are not an array: every row needs the same length") from error


def _time_columns(columns: MemoryColumns, taken: Sequence[str | None]) -> list[str]:
    return [
        name
        for name in columns.load
        if name not in taken and looks_like_time(name) and seconds_per_unit(name) is not None
    ]


def _make_table(columns: MemoryColumns, taken: Sequence[str | None], reading: ReadingOptions) -> ColumnarFile:
    loads = dict(columns.load)
    if columns.time is not None and not _time_columns(columns, taken):
        name, times = columns.time
        loads[name] = lambda: times
    return ColumnarFile(_TITLE, tuple(loads), lambda name: loads[name](), missing=reading.missing)
