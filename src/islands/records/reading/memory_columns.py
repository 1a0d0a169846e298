"""Columns of data in memory: frames of pandas and polars, xarray data sets and mappings.

Frames are read through narwhals, which imports none of their libraries.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.records.masked_values import fill_masked
from islands.records.reading.column_names import looks_like_time, seconds_per_unit
from islands.records.reading.formats.text.time_stamps import kind_of, parse_stamps
from islands.records.reading.table import RowRange

if TYPE_CHECKING:
    import xarray

#: Name of a DataArray without a name, while it is a variable.
_CHANNEL = "islands: channel"

#: Column that a time index without a name becomes.
_TIME = "time"

#: Column that a coordinate with a unit of time becomes.
_SECONDS = "time_s"


@dataclass(frozen=True, slots=True, eq=False)
class MemoryColumns:
    """Columns of data in memory, as arrays on demand.

    Attributes
    ----------
    load : mapping
        Functions that return a column, by its name. Times are in the unit of the name.
    time : (str, ndarray) or None
        Times of an index or of a coordinate, in the unit of their name.
    units : mapping
        Units that the data state, by column.
    """

    load: Mapping[str, Callable[[], NDArray[Any]]]
    time: tuple[str, NDArray[np.float64]] | None = None
    units: Mapping[str, str] = field(default_factory=dict)


def read_columns_in_memory(data: Any) -> MemoryColumns | None:
    """Return the columns of a frame, a series, an xarray Dataset or a mapping; None for an array.

    Raises
    ------
    RecordError
        Two columns have the same name, or a lazy frame is not collected.
    """
    if isinstance(data, np.ndarray) and data.dtype.names:
        data = {name: data[name] for name in data.dtype.names}
    if hasattr(data, "data_vars"):
        return _read_xarray(data)
    if hasattr(data, "to_dataset"):
        return _read_data_array(data)
    if isinstance(data, Mapping):
        return MemoryColumns({str(name): partial(_load_array, values) for name, values in data.items()})
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
    return MemoryColumns(loads, _find_time(frame, index))


def _load_array(values: Any) -> NDArray[Any]:
    return np.asarray(fill_masked(values))


def _load_series(series: Any) -> NDArray[Any]:
    """Return a series as an array; missing numbers are NaN, and times are in the unit of the series' name."""
    import narwhals.stable.v2 as nw  # noqa: PLC0415

    kind = series.dtype
    if kind.is_temporal():
        return _count_seconds(series) / (seconds_per_unit(str(series.name)) or 1.0)
    numeric = kind.is_numeric() or kind == nw.Boolean
    if numeric:
        numbers: NDArray[np.float64] = series.cast(nw.Float64).to_numpy()
        return numbers
    return _read_stamps(series.to_numpy(), str(series.name))


def _read_stamps(array: NDArray[Any], name: str) -> NDArray[Any]:
    """Return time stamps, as texts or objects of the class datetime, in the unit of their name.

    Other values are returned as they are.
    """
    values = array.tolist()
    known = [value for value in values if value is not None]
    if known and all(isinstance(value, datetime) for value in known):
        spans = [np.nan if value is None else (value - known[0]).total_seconds() for value in values]
        seconds = np.array(spans, np.float64)
    elif known and all(isinstance(value, str) for value in known) and kind_of(known[0]):
        texts = ["" if value is None else value for value in values]
        seconds = parse_stamps(texts, name, RowRange("the record", "sample", range(len(texts))), None, None)
    else:
        return array
    return seconds / (seconds_per_unit(name) or 1.0)


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

    if hasattr(index, "to_timestamp"):
        index = index.to_timestamp()  # the beginnings of periods
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


def _read_xarray(data: "xarray.Dataset") -> MemoryColumns:
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
                # "days since 2000-01-01" are the conventions for climate data, if they are not decoded.
                seconds = seconds_per_unit(f"t ({unit.partition(' since ')[0]})") if unit else None
                time = str(name) if seconds is None else _SECONDS, variable.values * (seconds or 1.0)
    units = {str(name): str(variable.attrs.get("units", "")) for name, variable in data.variables.items()}
    if time is not None:
        loads = {name: load for name, load in loads.items() if data[name].dims != (name,)}
    return MemoryColumns(loads, time, units)


def _read_data_array(data: "xarray.DataArray") -> MemoryColumns | None:
    """Return a DataArray as columns: a channel, or one for each label along its second dimension.

    None for an array without a coordinate, or of more dimensions.
    """
    if data.ndim == 1 and data.coords:
        name = str(data.name or "")
        found = _read_xarray(data.to_dataset(name=name or _CHANNEL))
        loads = {name if column == _CHANNEL else column: load for column, load in found.load.items()}
        return replace(found, load=loads)
    labelled = [dim for dim in data.dims if dim in data.coords]
    # The dimension of the time has more labels than there are channels.
    if data.ndim == 2 and len(labelled) == 2:
        channels = min(data.dims, key=lambda dim: data.sizes[dim])
        return _read_xarray(data.to_dataset(dim=channels))
    return None


def _load_variable(variable: "xarray.Variable") -> NDArray[Any]:
    values: NDArray[Any] = variable.values
    if values.dtype.kind not in "mM":
        return values
    ticks = values.astype("timedelta64[ns]" if values.dtype.kind == "m" else "datetime64[ns]").astype(
        np.int64
    )
    seconds: NDArray[np.float64] = (ticks - ticks.min() * (values.dtype.kind == "M")) * 1e-9
    return seconds
