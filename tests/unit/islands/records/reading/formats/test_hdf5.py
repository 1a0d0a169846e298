"""HDF5 files: the datasets of a group, its units, and no reference to another file."""

import h5py
import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import preview, read_columns, read_record
from islands.records.reading.options import ReadingOptions

K = np.arange(60)
COLUMNS = {"t_s": K / 100, "u": K % 7 - 3.0, "y": K * K % 11 + 0.5}


@pytest.fixture
def hdf5(tmp_path):
    def write(fill):
        with h5py.File(tmp_path / "r.h5", "w", track_order=True) as file:
            fill(file)
        return tmp_path / "r.h5"

    return write


def fill(group, **options):
    for name, values in COLUMNS.items():
        group.create_dataset(name, data=values, **options)


@pytest.mark.parametrize("options", [{}, {"compression": "gzip"}, {"compression": "lzf", "shuffle": True}])
def test_the_first_group_with_a_table_is_read_and_the_others_are_named(hdf5, options):
    def write(file):
        file["note"] = "bench 3"
        fill(file.create_group("one/run"), **options)
        fill(file.create_group("two"), **options)

    path = hdf5(write)
    assert read_record(path, ["u"], "y").u[:, 0].tolist() == COLUMNS["u"].tolist()
    assert preview(path).warnings == ("the group one/run of r.h5 is read; other groups (sheet=): two",)
    assert read_record(path, ["u"], "y", sheet="two").samples == 60
    with pytest.raises(RecordError, match=r"r\.h5 has no group three; its groups are one/run, two"):
        read_record(path, ["u"], "y", sheet="three")
    with pytest.raises(RecordError, match=r"has no column z.*other groups"):
        read_record(path, ["z"], "y")


def test_a_unit_is_an_attribute_and_a_matrix_has_numbered_channels(hdf5):
    def write(file):
        fill(file)
        file["u"].attrs["units"] = "V"
        file["z"] = np.column_stack([K, K + 1.0])

    path = hdf5(write)
    assert read_columns(path) == ("t_s", "u [V]", "y", "z_1", "z_2")
    assert read_record(path, ["u"], "z_2").input_units == ("V",)


def test_a_stated_fill_value_is_missing(hdf5):
    def write(file):
        fill(file)
        file["y"][[20, 41]] = 9.96921e36
        file["y"].attrs["_FillValue"] = 9.96921e36

    record = read_record(hdf5(write), ["u"], "y", outliers="keep")
    assert np.flatnonzero(np.isnan(record.y)).tolist() == [20, 41]


def test_a_dataset_of_records_is_a_table(hdf5):
    records = np.array(list(zip(*COLUMNS.values(), strict=True)), dtype=[(name, "f8") for name in COLUMNS])
    path = hdf5(lambda file: file.create_dataset("runs/log", data=records))
    assert read_columns(path, ReadingOptions(sheet="runs/log")) == tuple(COLUMNS)
    assert read_record(path, ["u"], "y").y.tolist() == COLUMNS["y"].tolist()


def test_other_files_are_never_read(hdf5, tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["u"] = COLUMNS["u"]

    def write(file):
        file["y"], file["x"] = COLUMNS["y"], COLUMNS["u"]
        file["u"] = h5py.ExternalLink("other.h5", "u")

    with pytest.raises(RecordError, match="references are never followed"):
        read_record(hdf5(write), ["u"], "y", dt=1.0)


def test_a_declared_size_without_stored_bytes_is_refused(hdf5):
    path = hdf5(
        lambda file: (fill(file), file.create_dataset("x", shape=(10**8,), dtype="f8", chunks=(10**6,)))
    )
    with pytest.raises(RecordError, match="x declares"):
        read_record(path, ["x"], "y")


@pytest.mark.parametrize("content", [b"", b"\x89HDF\r\n\x1a\n" + b"\0" * 100, b"t,u,y"])
def test_a_damaged_file_is_refused(tmp_path, content):
    (tmp_path / "r.h5").write_bytes(content)
    with pytest.raises(RecordError, match=r"r\.h5 is (damaged|not an HDF5 file)"):
        read_record(tmp_path / "r.h5", ["u"], "y")
