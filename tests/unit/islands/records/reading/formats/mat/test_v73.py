"""Malicious MAT-files of version 7.3: wrong sizes, and references to other files, which HDF5 allows."""

import h5py
import numpy as np
import pytest

from islands.records.reading import read_columns, read_record
from islands.records.reading.formats.mat.file import read_matlab
from islands.records.reading.formats.mat.v73 import read_variables
from islands.records.reading.formats.mat.workspace import ADVICE

K = np.arange(60)
U, Y = K % 7 - 3.0, K * K % 11 + 0.5


@pytest.fixture
def hdf5(save):
    """Change a valid file of version 7.3."""

    def hdf5(change):
        path = save("7.3", u=U, y=Y, Ts=0.1, run={"w": U})
        with h5py.File(path, "r+") as file:
            change(file)
        return path

    return hdf5


def test_a_shape_or_a_chunk_above_the_sample_limit_is_refused(hdf5, refusal):
    def wide(file):
        file.create_dataset("x", (1, 2**40), "f8", chunks=(1, 2**16))
        file.create_dataset("z", (1, 60), "f8", chunks=(1, 2**28), maxshape=(1, None), compression="gzip")

    file = hdf5(wide)
    assert "column x declares 1099511627776 samples" in refusal(file)
    assert "column z declares 268435456 samples" in refusal(file, ["z"])


def test_a_filter_without_a_known_ratio_is_refused(hdf5, refusal):
    file = hdf5(lambda file: file.create_dataset("x", data=U[None, :], scaleoffset=3))
    assert "column x cannot be read (it is compressed by the filter number 6: save it" in refusal(file)


@pytest.mark.parametrize("shuffle", [False, True])
def test_a_nearly_constant_signal_may_use_the_full_compression_ratio(hdf5, shuffle):
    steps = np.repeat([0.0, 1.0], 500_000)[None, :]
    file = hdf5(
        lambda file: file.create_dataset("x", data=steps, chunks=(1, 10**5), compression=9, shuffle=shuffle)
    )
    assert read_matlab(file).load("x").sum() == 500_000


def test_other_files_are_never_read(hdf5, tmp_path, refusal):
    """With h5py alone, each of these references discloses the secret."""
    secret = np.arange(60.0) + 1000
    (tmp_path / "secret.bin").write_bytes(secret.tobytes())
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = secret[None, :]
        other["group/x"] = secret[None, :]

    def ways_out(file):
        outside = str(tmp_path / "other.h5")
        file["external"] = h5py.ExternalLink(outside, "/x")
        file["group"] = h5py.ExternalLink(outside, "/group")
        file["soft"] = h5py.SoftLink("/group/x")
        file.create_dataset("group.x", data=secret[None, :])  # as a path, it leads through the link
        file.create_dataset("raw", (1, 60), "f8", external=[(str(tmp_path / "secret.bin"), 0, 480)])
        layout = h5py.VirtualLayout((1, 60), "f8")
        layout[:] = h5py.VirtualSource(outside, "x", (1, 60))
        file.create_virtual_dataset("virtual", layout)
        assert file["external"][0, 0] == file["raw"][0, 0] == file["soft"][0, 0] == 1000

    file = hdf5(ways_out)
    assert read_record(file, ["u"], "y").samples == 60
    assert set(read_columns(file)) == {"u", "y", "Ts", "run.w", "external", "group", "soft", "raw", "virtual"}
    for name in ("external", "group", "soft", "raw", "virtual"):
        assert refusal(file, [name]) == (
            f"r.mat: column {name} holds link where real numbers are expected: it refers to another place, "
            "and references are never followed; save the values themselves"
        )


def test_shapes_are_those_of_matlab(hdf5):
    file = hdf5(lambda file: file.create_dataset("x", data=np.ones((2, 3, 4))))
    assert next(variable.shape for variable in read_variables(file) if variable.name == "x") == (4, 3, 2)


def test_cycles_of_groups_are_refused(hdf5, refusal):
    def ring(file):
        file["run/a"] = file["run"]

    assert "a structure occurs in two places, run and run.a" in refusal(hdf5(ring))


def test_the_nesting_of_groups_is_limited(hdf5, refusal):
    file = hdf5(lambda file: file.create_group("/".join("a" * 40)))
    assert "structures are nested more than 32 deep" in refusal(file)


@pytest.mark.parametrize(
    ("kind", "attributes"),
    [("timeseries", {"MATLAB_object_decode": 3}), ("function_handle", {}), ("cell", {}), ("string", {})],
)
def test_objects_of_version_7_3_are_refused_with_advice(hdf5, kind, attributes, refusal):
    def store(file):
        number = {"MATLAB_object_decode": 3} if kind == "string" else attributes
        stored = file.create_dataset("x", data=np.array([[1, 2]], "u4") if number else [[file["u"].ref]])
        for name, value in {"MATLAB_class": np.bytes_(kind), **number}.items():
            stored.attrs[name] = value

    message = refusal(hdf5(store))
    assert f"column x holds {kind}" in message
    assert ADVICE[kind].format(x="x") in message
