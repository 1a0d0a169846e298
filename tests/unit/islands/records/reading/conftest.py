"""Fixtures for the readers: files as MATLAB saves them, and refusals with a memory limit."""

import tracemalloc

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import issparse

from islands.errors import RecordError
from islands.records.reading import read_record

_CLASSES = {"float64": "double", "float32": "single", "bool": "logical"}


def _hdf5(path, variables):
    """Write version 7.3: a header of 512 bytes, then HDF5 with reversed axes and classes as attributes."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_group("#refs#")
        for name, value in variables.items():
            _member(file, name, value)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def _member(group, name, value):
    if isinstance(value, dict):
        member = group.create_group(name)
        for field, inner in value.items():
            _member(member, field, inner)
        kind = "struct"
    elif issparse(value):
        member, kind = group.create_group(name), "double"
        member.attrs["MATLAB_sparse"] = np.uint64(value.shape[0])
        member["data"] = value.data
    elif isinstance(value, list):
        cells = [
            group.file["#refs#"].create_dataset(f"{name}{index}", data=cell)
            for index, cell in enumerate(value)
        ]
        member = group.create_dataset(name, data=[[cell.ref] for cell in cells], dtype=h5py.ref_dtype)
        kind = "cell"
    elif isinstance(value, str):
        member, kind = (
            group.create_dataset(name, data=[[ord(letter)] for letter in value], dtype="u2"),
            "char",
        )
    else:
        array = np.atleast_2d(value)
        kind = _CLASSES.get(array.dtype.name, array.dtype.name)
        if array.dtype.kind == "c":
            array, kind = array.view([("real", "f8"), ("imag", "f8")]), "double"
        packed = {"compression": "gzip"} if array.size > 20 else {}
        turned = array.T.astype("u1") if kind == "logical" else array.T
        member = group.create_dataset(name, data=turned if array.size else np.array(array.shape), **packed)
        if not array.size:
            member.attrs["MATLAB_empty"] = np.uint8(1)
    member.attrs["MATLAB_class"] = np.bytes_(kind)


def _with_cells(value):
    if isinstance(value, dict):
        return {name: _with_cells(inner) for name, inner in value.items()}
    return np.array(value, dtype=object) if isinstance(value, list) else value


_SAVERS = {
    "4": lambda path, variables: savemat(path, variables, format="4"),
    "6": lambda path, variables: savemat(path, _with_cells(variables)),
    "7": lambda path, variables: savemat(path, _with_cells(variables), do_compression=True),
    "7.3": _hdf5,
}


@pytest.fixture
def save(tmp_path):
    """Write variables like ``save -v4``, ``-v6``, ``-v7`` and ``-v7.3``; a dictionary is a structure."""

    def save(version, name="r.mat", **variables):
        _SAVERS[version](tmp_path / name, variables)
        return tmp_path / name

    return save


@pytest.fixture
def refusal():
    """Read a record that is refused, with a memory limit of some megabytes; return the message."""

    def refusal(file, inputs=("x",), output="y"):
        tracemalloc.start()
        with pytest.raises(RecordError) as caught:
            read_record(file, inputs, output)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 20e6
        return str(caught.value)

    return refusal
