"""Preview: every column of a file, with the messages of `read_record` as its problems."""

import subprocess
import sys

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import READERS, preview, read_record

SAMPLES = 60
K = np.arange(SAMPLES)
T, U, Y = K / 100, K % 7 - 3.0, K * K % 11 + 0.5


def table(tmp_path, separator=",", comma=False, drop=(), **columns):
    """Write t_s, u_V, y_um and further text columns; return the file."""
    columns = {
        name: column
        for name, column in ({"t_s": T, "u_V": U, "y_um": Y} | columns).items()
        if name not in drop
    }
    rows = [columns, *zip(*columns.values(), strict=True)]
    cells = ([str(cell).replace(".", ",") if comma else str(cell) for cell in row] for row in rows)
    (tmp_path / "r.csv").write_text("\n".join(map(separator.join, cells)))
    return tmp_path / "r.csv"


def archive(tmp_path, **arrays):
    np.savez(tmp_path / "r.npz", **arrays)
    return tmp_path / "r.npz"


def cells(values, **changed):
    """Return values as text cells, with some cells replaced: ``c5="off"``."""
    texts = [str(value) for value in values]
    for place, text in changed.items():
        texts[int(place[1:])] = text
    return texts


def problems(file):
    return {column.name: column.problem for column in preview(file).columns if column.problem}


def refusal(file, inputs, output, **options):
    with pytest.raises(RecordError) as caught:
        read_record(file, inputs, output, **options)
    return str(caught.value)


def write_parquet(file, columns):
    import pyarrow as pa
    from pyarrow import parquet

    parquet.write_table(pa.table(columns), file)


def write_workbook(file, columns):
    import openpyxl

    book = openpyxl.Workbook()
    for row in [list(columns), *zip(*(column.tolist() for column in columns.values()), strict=True)]:
        book.active.append(row)
    book.save(file)


def write_hdf5(file, columns):
    import h5py

    with h5py.File(file, "w", track_order=True) as opened:
        for name, values in columns.items():
            opened.create_dataset(name, data=values)


def write_mdf(file, columns):
    from asammdf import MDF, Signal

    with MDF(version="4.10") as made:
        made.append([Signal(columns[name], T, name=name) for name in ("u_V", "y_um")])
        made.save(file.with_suffix(".mf4"), overwrite=True)
    file.with_suffix(".mf4").rename(file)


def write_tdms(file, columns):
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("Bench", name, values) for name, values in columns.items()])


WRITERS = {
    ".npz": lambda file, columns: np.savez(file, **columns),
    ".parquet": write_parquet,
    ".xlsx": write_workbook,
    ".xlsm": write_workbook,
    ".h5": write_hdf5,
    ".hdf5": write_hdf5,
    ".mf4": write_mdf,
    ".mdf": write_mdf,
    ".tdms": write_tdms,
}


SLOW = {".mf4", ".mdf", ".xlsx", ".xlsm"}  # their libraries are imported in up to two seconds


@pytest.mark.parametrize(
    "suffix", [pytest.param(each, marks=pytest.mark.ci if each in SLOW else ()) for each in READERS]
)
def test_every_format_gives_the_same_preview(tmp_path, save, suffix):
    columns = {"t_s": T, "u_V": U, "y_um": Y}
    file = tmp_path / f"r{suffix}"
    if suffix == ".mat":
        save("7", **columns)
    elif suffix in WRITERS:
        WRITERS[suffix](file, columns)
    else:
        table(tmp_path).rename(file)
    assert preview(file) == preview(table(tmp_path))


# Problems of columns


@pytest.mark.parametrize("empty", [[5], range(40, SAMPLES)], ids=["single", "at the end"])
def test_missing_values_are_counted_and_are_no_problem_of_an_output(tmp_path, empty):
    file = table(tmp_path, x=cells(U, **{f"c{k}": "" for k in empty}))
    column, known = preview(file).columns[3], np.delete(U, empty)
    assert (column.problem, column.missing, column.samples) == ("", len(empty), SAMPLES)
    assert (column.minimum, column.maximum) == (known.min(), known.max())
    assert read_record(file, ["u_V"], "x").samples == SAMPLES
    assert "empty or NaN" in refusal(file, ["x"], "y_um")


def test_a_column_with_an_invalid_sample_has_no_statistics(tmp_path):
    file = table(tmp_path, b=cells(U, c5="inf"), c=[2.5] * SAMPLES, d=["x"] * SAMPLES)
    *_, infinite, constant, text = preview(file).columns
    for column in (infinite, text):
        assert (column.minimum, column.maximum, column.mean, column.deviation) == (None, None, None, None)
    assert text.samples is None
    assert (constant.minimum, constant.maximum, constant.mean, constant.deviation) == (2.5, 2.5, 2.5, 0.0)


def test_a_ragged_line_is_the_problem_of_every_column(tmp_path):
    file = table(tmp_path)
    file.write_text(file.read_text() + "\n0.6,1")
    message = refusal(file, ["u_V"], "y_um")
    assert problems(file) == dict.fromkeys(("t_s", "u_V", "y_um"), message)
    assert preview(file).samples == 0


def test_two_recordings_in_one_file_are_a_warning_not_a_problem(tmp_path):
    file = archive(tmp_path, u_test=U[:50], y_test=Y[:50], u=U, y=Y, dt=0.1)
    seen = preview(file)
    assert "dt" in problems(file)
    assert len(problems(file)) == 1
    assert seen.samples == SAMPLES
    assert seen.warnings == (refusal(file, ["u"], "u_test"),)
    assert read_record(file, ["u_test"], "y_test").samples == 50


def test_single_numbers_are_not_a_recording(tmp_path):
    file = archive(tmp_path, u=U, y=Y, gain=np.ones(1), offset=np.ones(1), dt=0.1)
    assert {"gain", "offset"} <= set(problems(file))
    assert preview(file).warnings == ()


# Warnings


# Time


@pytest.mark.parametrize(
    "time",
    [
        cells(T, c30="0.3025"),
        cells(T, c30="0.29"),
        cells(T, c30=""),
        cells(T, c0="10:15:00"),
        list(T[:30]) + list(T[30:] + 0.05),
    ],
    ids=["uneven", "repeated", "missing", "text", "gap"],
)
def test_an_unusable_time_column_is_a_warning(tmp_path, time):
    file = table(tmp_path, t_s=time)
    seen = preview(file)
    assert (seen.time, seen.dt) == ("t_s", None)
    assert seen.warnings == (refusal(file, ["u_V"], "y_um"),)


def test_a_first_column_in_a_unit_of_time_that_increases_is_the_time(tmp_path):
    """Oscilloscopes write the source of the channels above the time: ``Source,CH1,CH2``."""
    rows = [f"{t - 0.1:+.7f},{u:.5f},{y:.5f}" for t, u, y in zip(T, U, Y, strict=True)]
    file = tmp_path / "scope.csv"
    file.write_text("\n".join(["Source,CH1,CH2", "Second,Volt,Volt", *rows]))
    seen = preview(file)
    assert (seen.time, seen.dt) == ("Source [s]", pytest.approx(T[1] - T[0]))
    record = read_record(file, ["CH1"], "CH2")
    assert (record.dt, record.start) == (pytest.approx(T[1] - T[0]), pytest.approx(-0.1))
    for other in ("Source,CH1,CH2\nVolt,Volt,Volt", "Source,CH1,CH2\nSecond,Volt,Volt\n5,0,0"):
        file.write_text("\n".join([other, *rows]))
        assert preview(file).time is None


def test_readers_of_rare_formats_import_their_libraries_on_demand():
    rare = ("asammdf", "h5py", "nptdms", "openpyxl", "pyarrow", "scipy")
    program = f"import sys, islands.records.reading; print([m for m in {rare} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
