"""HDF5 files (.h5, .hdf5): the datasets of one group. References to other files are never followed."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.records.masked_values import fill_masked
from islands.records.reading.column_names import append_unit
from islands.records.reading.formats.columnar import ColumnarFile
from islands.records.reading.formats.groups import choose_group
from islands.records.reading.formats.mat.v73 import check_dataset_size
from islands.records.reading.formats.mat.workspace import DAMAGED, Variable, make_columns
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.size_limits import MOST_COLUMNS
from islands.records.reading.validation import MIN_SAMPLES

_MAX_DEPTH = 32

#: Attributes with the numbers that mark a missing value, by the conventions of netCDF.
_MISSING = ("_FillValue", "missing_value")

#: Attributes with the unit of a dataset.
_UNITS = ("unit", "units", "Unit", "Units", "UNIT", "UNITS")


def read_hdf5(path: Path, options: ReadingOptions = DEFAULT_READING) -> ColumnarFile:
    """Open an HDF5 file.

    The columns are the datasets of a group, or the fields of a dataset of records. A dataset with two
    dimensions gives a column for each channel: ``x_1``, ``x_2``, ... The unit of a dataset is its attribute
    ``unit`` or ``units``; a number that its attribute ``_FillValue`` or ``missing_value`` states is missing.

    Raises
    ------
    RecordError
        The file is not an HDF5 file or is damaged, or it has no such group.
    """
    import h5py  # noqa: PLC0415

    options.check_array_file(path.name, sheets=True)
    try:
        if not h5py.is_hdf5(path):
            raise RecordError(f"{path.name} is not an HDF5 file: write it again")
        with h5py.File(path, "r", locking=False) as file:
            groups = dict(_iterate_tables(file, "/", 0, [0]))
        tables = {name: _is_table(variables) for name, variables in groups.items()}
        group, others = choose_group(tables, options.sheet, path.name)
        # A dataset of records is stored by rows: reading one of its columns reads all of them.
        read_records = lru_cache(1)(partial(_read_records, path, group))
        variables = [
            Variable(
                append_unit(key, member[2]),
                member[0],
                member[1],
                partial(_read, path, group, key, read_records),
            )
            for key, member in groups[group].items()
        ]
    except DAMAGED as error:
        raise RecordError(f"{path.name} is damaged or truncated ({error}): save it again") from error
    return replace(make_columns(variables, path.name, options.missing), others=others)


def _iterate_tables(
    group: Any, name: str, depth: int, seen: list[int]
) -> Iterator[tuple[str, Mapping[str, tuple[str, tuple[int, ...], str]]]]:
    """Yield groups and datasets of records by path, with kind, shape and unit of each column.

    ``seen`` counts the members of the whole file: by hard links, a small file has any number of paths.
    """
    import h5py  # noqa: PLC0415

    seen[0] += len(group)
    if depth > _MAX_DEPTH or seen[0] > MOST_COLUMNS:
        raise ValueError(
            f"groups are nested more than {_MAX_DEPTH} deep or contain more than {MOST_COLUMNS} members"
        )
    columns: dict[str, tuple[str, tuple[int, ...], str]] = {}
    inner = []
    for key in group:
        if isinstance(key, bytes):
            raise ValueError(f"the name {key!r} is not UTF-8")
        hard = group.id.links.get_info(key.encode()).type == h5py.h5l.TYPE_HARD
        member = group[key] if hard else None
        place = key if name == "/" else f"{name}/{key}"
        if isinstance(member, h5py.Group):
            inner.append((member, place))
        elif isinstance(member, h5py.Dataset) and (dtype := member.dtype).names:
            shape, kind = member.shape, _kind(member, np.dtype(float))
            yield place, {each: (kind or _name_kind(dtype[each]), shape, "") for each in dtype.names}
        elif isinstance(member, h5py.Dataset):
            columns[key] = (_kind(member, member.dtype), member.shape or (), _unit(member))
        elif member is None:
            columns[key] = ("link", (), "")
    if columns:
        yield name, columns
    for member, place in inner:
        yield from _iterate_tables(member, place, depth + 1, seen)


def _kind(dataset: Any, dtype: np.dtype[Any]) -> str:
    if dataset.is_virtual or dataset.external:
        return "link"
    return _name_kind(dtype)


def _name_kind(dtype: np.dtype[Any]) -> str:
    return "" if dtype.kind in "fiub" else str(dtype)


def _unit(dataset: Any) -> str:
    for name in _UNITS:
        value = dataset.attrs.get(name)
        if value is not None:
            return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
    return ""


def _is_table(columns: Mapping[str, tuple[str, tuple[int, ...], str]]) -> bool:
    """Return whether there are two or more channels."""
    shapes = [
        shape for kind, shape, _ in columns.values() if not kind and max(shape, default=0) >= MIN_SAMPLES
    ]
    return len(shapes) > 1 or any(len(shape) == 2 and min(shape) > 1 for shape in shapes)


def _read(path: Path, group: str, key: str, read_records: Callable[[], NDArray[Any] | None]) -> NDArray[Any]:
    import h5py  # noqa: PLC0415

    records = read_records()
    if records is not None:
        return records[key]
    with h5py.File(path, "r", locking=False) as file:
        dataset = file[group][key]
        check_dataset_size(dataset, key, path)
        values = np.asarray(dataset[()])
        marks = [np.ravel(dataset.attrs[name]) for name in _MISSING if name in dataset.attrs]
        if not marks or values.dtype.kind not in "fiu":
            return values
        return np.asarray(fill_masked(np.ma.array(values, mask=np.isin(values, np.concatenate(marks)))))


def _read_records(path: Path, name: str) -> NDArray[Any] | None:
    """Read a dataset of records; return None for a group."""
    import h5py  # noqa: PLC0415

    with h5py.File(path, "r", locking=False) as file:
        dataset = file[name]
        if not isinstance(dataset, h5py.Dataset):
            return None
        check_dataset_size(dataset, name, path)
        return np.asarray(dataset[()])
