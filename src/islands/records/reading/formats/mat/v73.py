"""MAT-files of version 7.3 (HDF5). References to other files are never followed.

HDF5 can refer to other files by links, external storage and virtual datasets. A reader that follows them lets
the author of a file read local files of the machine (github.com/h5py/h5py/issues/2891).
"""

import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.records.reading.formats.mat.workspace import Variable
from islands.records.reading.size_limits import check_samples, check_stored

_DEFLATE, _LZF = 1, 32000
_FILTERS = {_DEFLATE, _LZF, 2, 3}  # also shuffle and Fletcher's checksum
_MAX_DEPTH = 32  # nested groups


def read_variables(path: Path) -> Iterator[Variable]:
    """Yield the variables of a MAT-file of version 7.3 and the fields of its structures.

    Raises one of `islands.records.reading.formats.mat.workspace.DAMAGED` if the file is damaged.
    """
    import h5py  # noqa: PLC0415

    with h5py.File(path, "r", locking=False) as file:
        yield from _iterate_variables(file, (), path, {})


def _iterate_variables(
    group: Any, parents: tuple[str, ...], path: Path, seen: dict[int, str]
) -> Iterator[Variable]:
    """Yield the variables of a group.

    `seen` maps the addresses of visited groups to their names, because links in HDF5 can form cycles.
    """
    import h5py  # noqa: PLC0415

    name = ".".join(parents)
    first_name = seen.setdefault(h5py.h5o.get_info(group.id).addr, name)
    if first_name != name:
        raise ValueError(f"a structure occurs in two places, {first_name} and {name}")
    if len(parents) > _MAX_DEPTH:
        raise ValueError(f"structures are nested more than {_MAX_DEPTH} deep")
    for key, member in _iterate_members(group):
        place = (*parents, key)
        kind = "link" if member is None else _matlab_class(member)
        if kind == "struct" and not _is_struct_array(member):
            yield from _iterate_variables(member, place, path, seen)
            continue
        shape = () if kind else tuple(reversed(member.shape or ()))
        yield Variable(".".join(place), kind, shape, partial(_read_numbers, path, place))


def _iterate_members(group: Any) -> Iterator[tuple[str, Any]]:
    """Yield names and members of a group; a member is None if it is a link to another place."""
    import h5py  # noqa: PLC0415

    for key in group:
        # MATLAB's internal names begin with "#". A name such as "a.b" or "a/b" could bypass these checks as a
        # path.
        if isinstance(key, str) and key.isidentifier() and not key.startswith("__"):
            hard = group.id.links.get_info(key.encode()).type == h5py.h5l.TYPE_HARD
            yield key, group[key] if hard else None


def _matlab_class(member: Any) -> str:
    """Return the MATLAB class of a member; empty for numbers."""
    import h5py  # noqa: PLC0415

    attribute = member.attrs.get("MATLAB_class", b"")
    name = attribute.decode("latin-1") if isinstance(attribute, bytes) else str(attribute)
    if isinstance(member, h5py.Group):
        return "sparse" if "MATLAB_sparse" in member.attrs else name or "struct"
    if not isinstance(member, h5py.Dataset):
        return "datatype"
    if member.is_virtual or member.external:
        return "link"
    if name == "char" or "MATLAB_object_decode" in member.attrs:
        return name
    if member.dtype.kind == "c" or member.dtype.names == ("real", "imag"):
        return "complex"
    return "" if member.dtype.kind in "fiub" else name or str(member.dtype)


def _is_struct_array(group: Any) -> bool:
    """Return whether a group is an array of structures: its fields are then references without a class."""
    import h5py  # noqa: PLC0415

    return any(
        isinstance(member, h5py.Dataset) and member.dtype.kind == "O" and "MATLAB_class" not in member.attrs
        for _, member in _iterate_members(group)
    )


def _read_numbers(path: Path, place: tuple[str, ...]) -> NDArray[Any]:
    """Read a dataset of numbers with MATLAB's order of axes."""
    import h5py  # noqa: PLC0415

    with h5py.File(path, "r", locking=False) as file:
        dataset = file["/".join(place)]
        if "MATLAB_empty" in dataset.attrs:
            return np.empty((0, 0))
        check_dataset_size(dataset, ".".join(place), path)
        return np.asarray(dataset[()]).T


def check_dataset_size(dataset: Any, column: str, path: Path) -> None:
    """Check the shape and the chunk size against the stored bytes. A chunk is decompressed as a whole.

    Raises
    ------
    RecordError
        The declared size is impossible or too large.
    ValueError
        A filter is not supported.
    """
    properties = dataset.id.get_create_plist()
    filters = [properties.get_filter(index)[0] for index in range(properties.get_nfilters())]
    if unknown := set(filters) - _FILTERS:
        raise ValueError(f"it is compressed by the filter number {min(unknown)}: save it with gzip")
    samples = max(dataset.size, math.prod(dataset.chunks or (0,)))
    check_samples(samples, column, path.name)
    stored = min(dataset.id.get_storage_size(), path.stat().st_size)
    check_stored(
        samples * dataset.dtype.itemsize, stored, bool({_DEFLATE, _LZF} & set(filters)), column, path.name
    )
