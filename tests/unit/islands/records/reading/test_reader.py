"""Reading of records: every dialect and format gives back numbers, names, units and times."""

import hashlib
from pathlib import Path

import numpy as np
import pytest

from islands.errors import IslandsError, RecordError
from islands.records.channel_names import parse_unit
from islands.records.reading import READERS, fingerprint, read_record
from islands.records.reading.column_names import find_column, looks_like_time
from support.bad_records import refusal

SAMPLES = 50
T = 0.01 * np.arange(SAMPLES)
U = np.round(np.sin(7 * T), 4)
Y = np.round(2.5 * np.cos(5 * T), 4)


def written(
    path: Path, separator: str = ",", comma: bool = False, end: str = "\n", name: str = "r.csv"
) -> Path:
    """Write T, U, Y as a text table in the given dialect."""
    lines = [separator.join(("t_s", "u_V", "y_um"))]
    for values in zip(T, U, Y, strict=True):
        cells = (f"{value:.4f}" for value in values)
        lines.append(separator.join(cell.replace(".", ",") if comma else cell for cell in cells))
    file = path / name
    file.write_bytes((end.join(lines) + end).encode())
    return file


def archive(path: Path, **arrays: object) -> Path:
    """Write a NumPy archive with U and Y, which the given arrays replace or complete."""
    file = path / "r.npz"
    np.savez(file, **({"u": U, "y": Y} | arrays))
    return file


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    ("separator", "comma"),
    [
        (",", False),
        (";", False),
        (";", True),
        ("\t", False),
        ("\t", True),
        ("|", True),
        (" ", False),
        ("   ", True),
    ],
)
def test_every_dialect_returns_the_written_numbers(tmp_path, separator, comma, end):
    record = read_record(written(tmp_path, separator, comma, end), ["u_V"], "y_um")
    assert record.u[:, 0].tolist() == U.tolist()
    assert record.y.tolist() == Y.tolist()
    assert record.dt == pytest.approx(0.01, rel=1e-12)


def test_a_record_carries_names_and_units_of_its_columns(tmp_path):
    record = read_record(written(tmp_path), ["u_V"], "y_um")
    assert (record.input_names, record.output_name) == (("u_V",), "y_um")
    assert (record.input_units, record.output_unit) == (("V",), "um")
    assert record.segments == (SAMPLES,)


# Time


@pytest.mark.parametrize(
    ("name", "seconds"),
    [
        ("t", 1.0),
        ("T", 1.0),
        ("time", 1.0),
        ("t_s", 1.0),
        ("T_s", 1.0),
        ("t_ms", 1e-3),
        ("time_us", 1e-6),
        ("TIME_NS", 1e-9),
        ("t_min", 60.0),
        ("time_h", 3600.0),
        ("Time (ms)", 1e-3),
        ("t [us]", 1e-6),
        ("Temps (ms)", 1e-3),
        ("Время (мин)", 60.0),
        ("时间（秒）", 1.0),
        ("時間[ms]", 1e-3),
        ("Tiempo", 1.0),
        ("Test_Time(s)", 1.0),
        ("Laufzeit / ms", 1e-3),
    ],
)
def test_a_time_column_is_read_in_its_unit(tmp_path, name, seconds):
    file = written(tmp_path)
    file.write_text(file.read_text().replace("t_s", name))
    record = read_record(file, ["u_V"], "y_um", rows=slice(5, None))
    assert record.dt == pytest.approx(0.01 * seconds, rel=1e-12)
    assert record.start == pytest.approx(0.05 * seconds, rel=1e-12)


@pytest.mark.parametrize(
    "name",
    [
        "T_K",
        "T_degC",
        "T_in_C",
        "temperature",
        "tank",
        "test",
        "T (K)",
        "temps",
        "tempo_Hz",
        "Horatio",
        "test_time",
        "rise time (s)",
    ],
)
def test_a_column_with_another_name_is_not_the_time(name):
    assert not looks_like_time(name)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("u_V", "V"),
        ("y_um", "um"),
        ("T_K", "K"),
        ("u_est_V", "V"),
        ("u", ""),
        ("force", ""),
        ("u_1", ""),
        ("u_", ""),
        ("u [V]", "V"),
        ("flow (m^3/s)", "m^3/s"),
        ("电压（V）", "V"),
    ],
)
def test_a_unit_follows_the_last_underscore_or_is_in_brackets(name, unit):
    assert parse_unit(name) == unit


@pytest.mark.parametrize(
    ("name", "columns", "found"),
    [
        ("pump", ("pump [%]", "level [cm]"), "pump [%]"),
        ("force", ("Time/s", "force/N"), "force/N"),
        ("acc", ("acc/(m/s^2)",), "acc/(m/s^2)"),
        ("force+1", ("force/N",), "force/N"),
        ("u", ("u/V", "u"), "u"),
        ("u", ("u/V", "u/mV"), "u"),
        ("a", ("a/b",), "a"),
        ("u", ("u_V",), "u"),
    ],
)
def test_a_name_without_its_unit_finds_the_only_column_with_one(name, columns, found):
    assert find_column(name, columns) == found


# Rows


@pytest.mark.parametrize(
    ("rows", "first", "last"),
    [
        (slice(10, 45), 10, 45),
        (slice(0, 40), 0, 40),
        (slice(None, 40), 0, 40),
        (slice(15, None), 15, 50),
        (slice(-35, -1), 15, 49),
    ],
)
def test_rows_select_samples_counted_from_zero_without_the_header(tmp_path, rows, first, last):
    for file, columns in ((written(tmp_path), (["u_V"], "y_um")), (archive(tmp_path, dt=0.01), (["u"], "y"))):
        record = read_record(file, *columns, rows=rows)
        assert record.y.tolist() == Y[first:last].tolist()
        assert record.start == pytest.approx(0.01 * first)


# A missing output


@pytest.mark.parametrize("cell", ["", "nan", "NaN", " NA "])
def test_a_missing_output_after_the_warm_up_is_accepted_on_request(tmp_path, cell):
    lines = written(tmp_path).read_text().splitlines()
    lines[11:] = [line.rpartition(",")[0] + "," + cell for line in lines[11:]]
    (tmp_path / "r.csv").write_text("\n".join(lines))
    record = read_record(tmp_path / "r.csv", ["u_V"], "y_um", missing_output=True)
    assert record.y[:10].tolist() == Y[:10].tolist()
    assert np.isnan(record.y[10:]).all()


# NumPy archives


# Column names and fingerprints


def test_a_fingerprint_is_the_sha_256_of_the_bytes(tmp_path):
    file = written(tmp_path)
    assert fingerprint(file) == hashlib.sha256(file.read_bytes()).hexdigest()
    other = written(tmp_path, end="\r\n", name="other.csv")
    assert fingerprint(other) != fingerprint(file)


def test_an_input_with_the_suffix_plus_one_is_read_one_sample_early(tmp_path):
    file = tmp_path / "record.csv"
    file.write_text("t_s,u_V,y_um\n" + "\n".join(f"{k / 10:g},{k * k},{k}" for k in range(40)))
    early, plain = (read_record(file, [name], "y_um") for name in ("u_V+1", "u_V"))
    assert early.input_names == ("u_V+1",)
    assert early.input_units == ("V",)
    assert np.array_equal(early.u[:-1], plain.u[1:])
    assert np.array_equal(early.y, plain.y)


# Invalid files


def test_a_file_that_cannot_be_opened_is_refused_with_the_reason(tmp_path):
    (tmp_path / "file.csv").write_text("t,u,y")
    with pytest.raises(RecordError, match=r"cannot be opened \(Not a directory\): check path"):
        read_record(tmp_path / "file.csv" / "bad.csv", ["u"], "y")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"dt": "0.1"}, "the sampling time dt must be a positive number of seconds, got '0.1'"),
        ({"resample": "0.1"}, "resample is a number above 0 s, got '0.1'"),
        ({"rows": (0, 30)}, r"rows is a slice such as slice\(0, 50\), got \(0, 30\)"),
    ],
)
def test_an_argument_of_another_type_is_refused(tmp_path, given, words):
    with pytest.raises(IslandsError, match=words):
        read_record(written(tmp_path), ["u_V"], "y_um", **given)


def test_an_unknown_suffix_is_refused_with_the_known_ones(tmp_path):
    message = refusal(tmp_path, ["a letter", "of two lines"], name="bad.docx")
    assert "bad.docx: files ending in '.docx' are not supported" in message
    assert all(suffix in message for suffix in READERS)
