"""Parquet files (.parquet), read by pyarrow (extra `parquet`)."""

import weakref
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.distribution import describe_missing_extra
from islands.errors import RecordError
from islands.records.reading.column_names import seconds_per_unit
from islands.records.reading.formats.columnar import ColumnarFile
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.size_limits import check_column_count, check_samples

#: Rows decoded at a time. Memory use then depends on the stored pages, not on the row count that the file
#: declares.
_BATCH = 2**16

#: Arrow's time units in seconds.
_TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def read_parquet(path: Path, options: ReadingOptions = DEFAULT_READING) -> ColumnarFile:
    """Open a Parquet file. Columns are read on demand.

    Numbers and booleans become float64, nulls become NaN. Dates and times become numbers in the unit of the
    column's name. Points in time are counted from the earliest one, because nanoseconds since 1970 exceed the
    precision of float64.

    Raises
    ------
    RecordError
        The file is not a Parquet file or is damaged, or pyarrow is not installed.
    """
    options.check_array_file(path.name)
    file = path.name
    if path.stat().st_size == 0:
        raise RecordError(f"{file} is empty: write it again")
    with ExitStack() as stack, _translated_errors(file):
        # Opening reads the description of all columns, so that the file is opened once for all of them. It is
        # not memory-mapped: truncating a mapped file would kill the process with SIGBUS.
        from pyarrow.parquet import ParquetFile  # noqa: PLC0415

        parquet = stack.enter_context(ParquetFile(path, memory_map=False, pre_buffer=False))
        check_column_count(range(parquet.metadata.num_columns), file)
        names, rows = tuple(parquet.schema_arrow.names), parquet.metadata.num_rows
        load = partial(_read_column, parquet, file, rows)
        table = ColumnarFile(file, names, load, missing=options.missing)
        weakref.finalize(table, stack.pop_all().close)
    return table


@contextmanager
def _translated_errors(file: str) -> Iterator[None]:
    try:
        import pyarrow  # noqa: PLC0415
    except ImportError as error:
        raise RecordError(
            f"{describe_missing_extra(file, 'parquet')}; or export the record as CSV"
        ) from error
    try:
        yield
    except MemoryError:  # also one of Arrow: the file may be as it should be
        raise
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise RecordError(f"{file} is damaged or not a Parquet file ({error}): write it again") from error


def _read_column(parquet: Any, file: str, rows: int, name: str) -> NDArray[Any]:
    import pyarrow  # noqa: PLC0415

    check_samples(rows, name, file)
    with _translated_errors(file):
        batches = parquet.iter_batches(_BATCH, columns=[name], use_threads=False)
        chunks = [batch.column(batch.schema.names.index(name)) for batch in batches]
        stored = sum(map(len, chunks))
        if stored != rows:
            raise RecordError(
                f"{file} declares {rows} rows and stores {stored}: it is damaged, write it again"
            )
        schema = parquet.schema_arrow
        kind = schema.field(schema.names.index(name)).type
        if pyarrow.types.is_dictionary(kind):
            chunks, kind = [chunk.dictionary_decode() for chunk in chunks], kind.value_type
        return _to_numbers(pyarrow.chunked_array(chunks, kind), name, file)


def _to_numbers(column: Any, name: str, file: str) -> NDArray[Any]:
    """Convert an Arrow column to float64, with NaN for nulls; a column of texts to an array of texts."""
    from pyarrow import compute, float64, types  # noqa: PLC0415

    kind = column.type
    if types.is_temporal(kind):
        return _to_elapsed(column, name)
    numeric = (types.is_integer, types.is_floating, types.is_decimal, types.is_boolean, types.is_null)
    if types.is_string(kind) or types.is_large_string(kind):
        return np.array(column.to_pylist(), dtype=object)
    if not any(test(kind) for test in numeric):
        raise RecordError(f"{file}: column {name} holds {kind} where real numbers are expected")
    numbers: NDArray[np.float64] = compute.cast(column, float64(), safe=False).to_numpy()
    return numbers


def _to_elapsed(column: Any, name: str) -> NDArray[np.float64]:
    """Convert times to numbers in the unit of the column's name, points in time relative to the earliest."""
    from pyarrow import chunked_array, compute, int32, int64, types  # noqa: PLC0415

    kind = column.type
    ticks = [
        chunk.view(int32() if kind.bit_width == 32 else int64()).cast(int64()) for chunk in column.chunks
    ]
    counted = chunked_array(ticks, int64())
    tick = 86_400.0 if types.is_date32(kind) else _TICKS[getattr(kind, "unit", "ms")]
    if types.is_timestamp(kind) or types.is_date(kind):
        counted = compute.subtract(counted, compute.min(counted))
    numbers: NDArray[np.float64] = compute.cast(counted, "float64", safe=False).to_numpy()
    return numbers * (tick / (seconds_per_unit(name) or 1.0))
