"""Records from data in memory: pandas and polars frames, xarray data sets, mappings and arrays.

Frames are read through narwhals, which imports none of their libraries. Their columns pass the checks of a
file.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from numbers import Real
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.data.dataset import Dataset
from islands.errors import RecordError, SettingsError
from islands.io.records.column_names import TIME_UNITS, find_column, looks_like_time, seconds_per_unit
from islands.io.records.formats.columnar import ColumnarFile
from islands.io.records.table_reading import read_table

if TYPE_CHECKING:
    import xarray
    from narwhals.typing import IntoDataFrame, IntoSeries

    #: Data with named columns.
    FrameLike: TypeAlias = IntoDataFrame | xarray.Dataset | Mapping[str, ArrayLike]

    #: What a record can be made of.
    RecordLike: TypeAlias = Dataset | FrameLike | IntoSeries | ArrayLike

#: Name of the data in messages.
_TITLE = "the record"

#: Column that a time index without a name becomes.
_TIME = "time"


@dataclass(frozen=True, slots=True, eq=False)
class _Columns:
    """Columns of data in memory, arrays on demand.

    ``time`` are the times of an index or of a coordinate, with the name of their column; ``units`` are those
    that the data state.
    """

    load: Mapping[str, Callable[[], NDArray[Any]]]
    time: tuple[str, NDArray[np.float64]] | None = None
    units: Mapping[str, str] = field(default_factory=dict)


def as_record(
    data: "RecordLike",
    y: "ArrayLike | IntoSeries | None" = None,
    dt: float | None = None,
    *,
    inputs: str | Sequence[str] = (),
    output: str | None = None,
    missing_output: bool = False,
) -> Dataset:
    """Make a record of a data frame or of arrays, and check it as `read_record` checks a file.

    Parameters
    ----------
    data : Dataset, data frame, xarray Dataset, mapping or array
        Columns by name (pandas, polars or another frame that narwhals reads, xarray, or a mapping of names to
        arrays); or the inputs alone, of shape (samples,) or (samples, inputs), if ``y`` is given. A `Dataset`
        is returned as it is.
    y : array, optional
        The output, of shape (samples,).
    dt : float, optional
        Sampling time in seconds. It may be left out if the data have a time: an index of times or of
        fractions of a second, the coordinate of an xarray Dataset, or a column that `read_record` would take
        as the time.
    inputs : str or sequence of str
        Names of the input columns, in the order of the model's inputs; ``u_V+1`` reads the column u_V one
        sample early.
    output : str
        Name of the output column.
    missing_output : bool
        Accept missing values of the output and constant columns, for a simulation.

    Returns
    -------
    Dataset

    Raises
    ------
    RecordError
        A column does not exist (the message lists them), has missing values or is constant, or the time is
        not uniform.
    SettingsError
        The arguments do not describe a record.
    """
    if isinstance(y, Dataset | float):
        raise SettingsError("the second argument is the output: give validation data as validation=...")
    if isinstance(data, Dataset):
        if y is not None or dt is not None or inputs or output is not None:
            raise SettingsError(
                "a Dataset already has its inputs, output and sampling time: give nothing else"
            )
        return data
    columns = _read_columns(data)
    if y is not None:
        if inputs or output is not None:
            raise SettingsError(
                "inputs and output name columns of a data frame: leave them out with two arrays"
            )
        inputs, output, columns = _join_output(data, columns, y)
    elif columns is None:
        raise SettingsError(
            "an array holds the inputs only: give the output and the sampling time as well, (u, y, dt)"
        )
    table = _make_table(columns, (*([inputs] if isinstance(inputs, str) else inputs), output))
    if output is None:
        raise SettingsError(
            f"no output is given: take one of the columns {', '.join(table.names)} as output=..."
        )
    record = read_table(table, _TITLE, inputs, output, dt, missing_output=missing_output)
    names = [*record.input_names, output]
    units = [
        columns.units.get(find_column(name, table.names)) or unit
        for name, unit in zip(names, (*record.input_units, record.output_unit), strict=True)
    ]
    return replace(record, input_units=tuple(units[:-1]), output_unit=units[-1])


def states_time(data: "RecordLike", taken: Sequence[str] = ()) -> bool:
    """Return whether data with named columns have a time besides the columns that are taken."""
    columns = _read_columns(data)
    return columns is not None and bool(columns.time or _time_columns(columns, taken))


def read_data(
    data: "RecordLike",
    y: "ArrayLike | IntoSeries | None",
    dt: float | None,
    inputs: str | Sequence[str],
    output: str | None,
    validation: "RecordLike | float",
) -> tuple[Dataset, Dataset | float]:
    """Return the record of a search, and its validation data with the same columns or their fraction."""
    record = as_record(data, y, dt, inputs=inputs, output=output)
    if isinstance(validation, Dataset | Real):
        return record, cast("Dataset | float", validation)
    columns = inputs or record.input_names
    return record, as_record(validation, dt=dt, inputs=columns, output=output or record.output_name)


def _read_columns(data: Any) -> _Columns | None:
    """Return the columns of named data; None for an array."""
    if isinstance(data, np.ndarray) and data.dtype.names:
        data = {name: data[name] for name in data.dtype.names}
    if hasattr(data, "data_vars"):
        return _read_xarray(data)
    if isinstance(data, Mapping):
        return _Columns({str(name): partial(np.asarray, values) for name, values in data.items()})
    # Importing narwhals takes some milliseconds, and arrays do not need it.
    import narwhals.stable.v2 as nw  # noqa: PLC0415

    try:
        frame = nw.from_native(data, pass_through=True, allow_series=True)
        if isinstance(frame, nw.Series):
            loads = {str(frame.name or ""): partial(_load_series, frame)}
        elif isinstance(frame, nw.DataFrame):
            loads = {str(name): partial(_load_series, frame.get_column(name)) for name in frame.columns}
        elif isinstance(frame, nw.LazyFrame):
            raise RecordError("a lazy frame has no data yet: collect it first")
        else:
            return None
    except nw.exceptions.DuplicateError as error:
        raise RecordError(f"two columns have the same name: rename one ({error})") from error
    index = nw.maybe_get_index(frame)
    return _Columns(loads, _find_time(frame, index))


def _load_series(series: Any) -> NDArray[Any]:
    """Return a series as an array; missing numbers are NaN, and times are in the unit of the series' name."""
    import narwhals.stable.v2 as nw  # noqa: PLC0415

    kind = series.dtype
    if kind.is_temporal():
        return _count_seconds(series) / (seconds_per_unit(str(series.name)) or 1.0)
    numeric = kind.is_numeric() or kind == nw.Boolean
    array: NDArray[Any] = series.cast(nw.Float64).to_numpy() if numeric else series.to_numpy()
    return array


def _count_seconds(series: Any) -> NDArray[np.float64]:
    """Return durations in seconds; points in time are counted from the earliest, exactly."""
    import narwhals.stable.v2 as nw  # noqa: PLC0415

    if series.dtype == nw.Duration:
        ticks = series.dt.total_nanoseconds()
    else:
        ticks = series.cast(nw.Datetime("us") if series.dtype == nw.Date else series.dtype).dt.timestamp("ns")
        ticks = ticks - ticks.min()
    seconds: NDArray[np.float64] = ticks.cast(nw.Float64).to_numpy() * 1e-9
    return seconds


def _find_time(frame: Any, index: Any) -> tuple[str, NDArray[np.float64]] | None:
    """Return the times of an index, or of the only column of points in time, as a column in seconds.

    An index of whole numbers without the name of a time counts samples.
    """
    import narwhals.stable.v2 as nw  # noqa: PLC0415

    if index is not None and getattr(index, "nlevels", 1) == 1:
        series = nw.from_native(index.to_series(), series_only=True)
        name = str(index.name or "")
        if series.dtype.is_temporal():
            return _TIME, _count_seconds(series)
        if series.dtype.is_numeric() and (name and looks_like_time(name)):
            return name, series.cast(nw.Float64).to_numpy()
        if series.dtype.is_float() and not name:
            return _TIME, series.to_numpy()
    if isinstance(frame, nw.DataFrame):
        temporal = [name for name, kind in frame.schema.items() if kind.is_temporal()]
        if len(temporal) == 1:
            return _TIME, _count_seconds(frame.get_column(temporal[0]))
    return None


def _read_xarray(data: "xarray.Dataset") -> _Columns:
    loads: dict[str, Callable[[], NDArray[Any]]] = {}
    time = None
    for name, variable in data.variables.items():
        loads[str(name)] = partial(_load_variable, variable)
        if variable.dims == (name,):
            kind, unit = variable.dtype.kind, str(variable.attrs.get("units", ""))
            # A coordinate that is not a time, such as the number of a sample, is a column like the others.
            if kind in "mM":
                time = _TIME, _load_variable(variable)
            elif kind in "fiu" and looks_like_time(str(name)):
                seconds = TIME_UNITS.get(unit)
                time = str(name) if seconds is None else _TIME, variable.values * (seconds or 1.0)
    units = {str(name): str(variable.attrs.get("units", "")) for name, variable in data.variables.items()}
    if time is not None:
        loads = {name: load for name, load in loads.items() if data[name].dims != (name,)}
    return _Columns(loads, time, units)


def _load_variable(variable: "xarray.Variable") -> NDArray[Any]:
    values: NDArray[Any] = variable.values
    if values.dtype.kind not in "mM":
        return values
    ticks = values.astype("timedelta64[ns]" if values.dtype.kind == "m" else "datetime64[ns]").astype(
        np.int64
    )
    seconds: NDArray[np.float64] = (ticks - ticks.min() * (values.dtype.kind == "M")) * 1e-9
    return seconds


def _join_output(data: Any, columns: _Columns | None, y: Any) -> tuple[tuple[str, ...], str, _Columns]:
    """Return the names of the inputs and of the output, and the columns of both."""
    if columns is None:
        u = np.asarray(data)
        names = ("u",) if u.ndim < 2 else tuple(f"u{place + 1}" for place in range(u.shape[1]))
        channels = u.reshape(len(u), -1).T
        columns = _Columns(
            {name: partial(np.asarray, channel) for name, channel in zip(names, channels, strict=True)}
        )
    loads = {name or "u": load for name, load in columns.load.items()}
    other = _read_columns(y) or _Columns({"": partial(np.asarray, y)})
    if len(other.load) != 1:
        raise RecordError(f"the output is one column, got {', '.join(other.load)}")
    ((name, load),) = other.load.items()
    output = name if name and name not in loads else "y"
    return tuple(loads), output, _Columns(loads | {output: load}, columns.time or other.time)


def _time_columns(columns: _Columns, taken: Sequence[str | None]) -> list[str]:
    return [
        name
        for name in columns.load
        if name not in taken and looks_like_time(name) and seconds_per_unit(name) is not None
    ]


def _make_table(columns: _Columns, taken: Sequence[str | None]) -> ColumnarFile:
    loads = dict(columns.load)
    if columns.time is not None and not _time_columns(columns, taken):
        name, times = columns.time
        loads[name] = lambda: times
    return ColumnarFile(_TITLE, tuple(loads), lambda name: loads[name]())
