"""Files with many members: each is opened once, and is refused before its columns are read."""

import io
import sys
import time
import zipfile
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading.preview import preview
from islands.records.reading.reader import open_record
from islands.records.reading.size_limits import MOST_COLUMNS

K = np.arange(40)


def arrays(count):
    return {f"c{index}": K * (index + 3) % 7.0 for index in range(count)}


def write_npz(path, count):
    np.savez(path, **arrays(count))


def write_mat(path, count):
    from scipy.io import savemat

    savemat(path, arrays(count))


def write_structure(path, count):
    from scipy.io import savemat

    savemat(path, {"run": arrays(count)}, do_compression=True)


def write_hdf5(path, count):
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in arrays(count).items():
            file[name] = values


def write_records(path, count):
    import h5py

    with h5py.File(path, "w") as file:
        file["table"] = np.zeros(len(K), [(name, "f8") for name in arrays(count)])


def write_parquet(path, count):
    import pyarrow
    from pyarrow.parquet import write_table

    write_table(pyarrow.table(arrays(count)), path)


def write_tdms(path, count):
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("g", name, values) for name, values in arrays(count).items()])


def write_text(path, count):
    columns = arrays(count)
    rows = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    path.write_text("\n".join(rows))


def write_workbook(path, count):
    import openpyxl

    book = openpyxl.Workbook()
    book.active.append(list(arrays(count)))
    for row in zip(*arrays(count).values(), strict=True):
        book.active.append(row)
    book.save(path)


FORMATS = {
    "r.npz": write_npz,
    "r.mat": write_mat,
    "run.mat": write_structure,
    "r.h5": write_hdf5,
    "records.h5": write_records,
    "r.parquet": write_parquet,
    "r.tdms": write_tdms,
    "r.csv": write_text,
    "r.xlsx": write_workbook,
}


def count_calls(path):
    """Return the number of calls of functions, in Python and C, of a preview."""
    calls = 0

    def count(_frame, event, _argument):
        nonlocal calls
        calls += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        preview(path)
    finally:
        sys.setprofile(None)
    return calls


@pytest.mark.ci
@pytest.mark.parametrize(("name", "write"), FORMATS.items(), ids=FORMATS)
def test_the_work_of_a_preview_is_proportional_to_the_number_of_columns(tmp_path, name, write):
    calls = []
    for count in (10, 40, 160):
        write(tmp_path / name, count)
        calls.append(count_calls(tmp_path / name))
    assert calls[2] - calls[1] <= 6 * (calls[1] - calls[0])


@pytest.mark.parametrize(
    ("name", "write", "opened"),
    [
        ("r.npz", write_npz, "zipfile.ZipFile.__init__"),
        ("r.parquet", write_parquet, "pyarrow.parquet.ParquetFile.__init__"),
        ("r.tdms", write_tdms, "nptdms.TdmsFile.__init__"),
    ],
)
def test_a_file_is_opened_once_for_all_columns_and_closed_with_its_table(
    tmp_path, monkeypatch, name, write, opened
):
    owner, _, method = opened.rpartition(".")
    module, _, kind = owner.rpartition(".")
    original, count = getattr(getattr(import_module(module), kind), method), []
    write(tmp_path / name, 5)
    monkeypatch.setattr(opened, lambda *args, **kwargs: (count.append(1), original(*args, **kwargs))[1])
    assert len(preview(tmp_path / name).columns) == 5
    assert len(count) == 1
    assert not [link for link in Path("/proc/self/fd").iterdir() if link.resolve() == tmp_path / name]


def test_an_archive_with_too_many_members_is_refused_by_its_directory(tmp_path):
    path = tmp_path / "r.npz"
    with zipfile.ZipFile(path, "w") as archive:
        for index in range(MOST_COLUMNS + 1):
            archive.writestr(f"{index}.npy", b"")
    start = time.process_time()
    with pytest.raises(RecordError, match=f"r.npz has more than {MOST_COLUMNS} columns or members"):
        open_record(path)
    assert time.process_time() - start < 1.0


@pytest.mark.parametrize("name", ["r.npz", "r.zip", "r.xlsx"])
def test_a_long_directory_is_refused_without_listing_it(tmp_path, name, monkeypatch):
    path = tmp_path / name
    with zipfile.ZipFile(path, "w") as archive:
        for index in range(5):
            archive.writestr(f"{index}.npy", b"")
    monkeypatch.setattr("islands.records.reading.size_limits.MOST_DIRECTORY", 100)
    monkeypatch.setattr("zipfile.ZipInfo", None)
    with pytest.raises(RecordError, match="has more than"):
        open_record(path)


def test_an_archive_with_too_many_unpacked_bytes_is_refused_at_once(tmp_path, monkeypatch):
    path = tmp_path / "r.npz"
    np.savez_compressed(path, u=np.zeros(6000), y=np.zeros(6000))
    monkeypatch.setattr("islands.records.reading.size_limits.MOST_UNPACKED", 90_000)
    with pytest.raises(RecordError, match="unpacks to more than"):
        open_record(path)
    np.savez(path, u=np.zeros(6000), y=np.zeros(6000))
    assert open_record(path).names == ("u", "y")


@pytest.mark.ci
def test_too_many_paths_through_the_groups_of_a_file_are_refused(tmp_path):
    import h5py

    path = tmp_path / "r.h5"
    with h5py.File(path, "w") as file:
        group = file
        for _ in range(25):
            group["a"] = inner = group.create_group("b")
            group = inner
        group["u"] = K
    with pytest.raises(RecordError, match=f"more than {MOST_COLUMNS} members"):
        open_record(path)


def test_a_sheet_with_a_remote_cell_is_refused(tmp_path, monkeypatch):
    import openpyxl

    monkeypatch.setattr("islands.records.reading.formats.excel._MOST_ROWS", 1000)

    book = openpyxl.Workbook()
    for row in K:
        book.active.append([float(row), float(row % 7)])
    stream = io.BytesIO()
    book.save(stream)
    path = tmp_path / "r.xlsx"
    with zipfile.ZipFile(stream) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            target.writestr(name, source.read(name).replace(b'<row r="40"', b'<row r="4000000000"'))
    with pytest.raises(RecordError, match="too many for a record: save only its cells as CSV"):
        open_record(path)
