"""MAT-files of version 7.3, which are HDF5: their variables, and nothing that lies outside of the file.

HDF5 can point into other files by links, by external storage and by virtual datasets: who reads such a file
reads the machine's own files for its author (github.com/h5py/h5py/issues/2891). None is ever followed.
"""

import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.io.records.mat.workspace import Variable
from islands.io.records.size_limits import check_samples, check_stored

_DEFLATE = 1
_FILTERS = {_DEFLATE, 2, 3}  # also shuffle and Fletcher's checksum: MATLAB uses no others
_DEEPEST = 32  # groups in one another


def read_variables(path: Path) -> Iterator[Variable]:
    """Yield the variables of a MAT-file of version 7.3, and the fields of its structures.

    Raises one of `islands.io.records.mat.workspace.DAMAGED` where the file is not what it claims to be.
    """
    import h5py  # noqa: PLC0415

    with h5py.File(path, "r", locking=False) as file:
        yield from _members(file, (), path, {})


def _members(group: Any, inside: tuple[str, ...], path: Path, seen: dict[int, str]) -> Iterator[Variable]:
    """Yield what a group holds; `seen` are the places of groups, which HDF5 can link to rings and worse."""
    import h5py  # noqa: PLC0415

    name = ".".join(inside)
    before = seen.setdefault(h5py.h5o.get_info(group.id).addr, name)
    if before != name:
        raise ValueError(f"a structure stands in two places, {before} and {name}")
    if len(inside) > _DEEPEST:
        raise ValueError(f"structures stand in one another more than {_DEEPEST} deep")
    for key, member in _links(group):
        place = (*inside, key)
        kind = "link" if member is None else _kind(member)
        if kind == "struct" and not _is_array(member):
            yield from _members(member, place, path, seen)
            continue
        shape = () if kind else tuple(reversed(member.shape or ()))
        yield Variable(".".join(place), kind, shape, partial(_numbers, path, place))


def _links(group: Any) -> Iterator[tuple[str, Any]]:
    """Yield names and members of a group; None for what is not in the group itself."""
    import h5py  # noqa: PLC0415

    for key in group:
        # MATLAB's own names begin with "#"; and "a.b", taken for a path, could lead past these checks.
        if isinstance(key, str) and key.isidentifier() and not key.startswith("__"):
            hard = group.id.links.get_info(key.encode()).type == h5py.h5l.TYPE_HARD
            yield key, group[key] if hard else None


def _kind(member: Any) -> str:
    """Return MATLAB's class of a member; empty for numbers."""
    import h5py  # noqa: PLC0415

    written = member.attrs.get("MATLAB_class", b"")
    name = written.decode("latin-1") if isinstance(written, bytes) else str(written)
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


def _is_array(group: Any) -> bool:
    """Tell whether a structure is one of several: its fields are then references, and belong to no class."""
    import h5py  # noqa: PLC0415

    return any(
        isinstance(member, h5py.Dataset) and member.dtype.kind == "O" and "MATLAB_class" not in member.attrs
        for _, member in _links(group)
    )


def _numbers(path: Path, place: tuple[str, ...]) -> NDArray[Any]:
    """Read a dataset of numbers, axes as in MATLAB."""
    import h5py  # noqa: PLC0415

    with h5py.File(path, "r", locking=False) as file:
        dataset = file["/".join(place)]
        if "MATLAB_empty" in dataset.attrs:
            return np.empty((0, 0))
        _check_claims(dataset, ".".join(place), path)
        return np.asarray(dataset[()]).T


def _check_claims(dataset: Any, column: str, path: Path) -> None:
    """Hold shape and chunks, each of which is unpacked as a whole, against the bytes that are stored."""
    packing = dataset.id.get_create_plist()
    filters = [packing.get_filter(index)[0] for index in range(packing.get_nfilters())]
    if strange := set(filters) - _FILTERS:
        raise ValueError(f"it is packed by a filter that MATLAB does not use, number {min(strange)}")
    samples = max(dataset.size, math.prod(dataset.chunks or (0,)))
    check_samples(samples, column, path.name)
    stored = min(dataset.id.get_storage_size(), path.stat().st_size)
    check_stored(samples * dataset.dtype.itemsize, stored, _DEFLATE in filters, column, path.name)
