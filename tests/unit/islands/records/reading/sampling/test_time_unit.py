"""Unit of a numeric time: dates as numbers are recognised, stated, and read with the step of their clock."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from islands.errors import RecordError, SettingsError
from islands.records.reading import read_record
from support.bad_records import refusal

SAMPLES = 300
K = np.arange(SAMPLES)
NOON = datetime(2025, 11, 26, 12)


def table(name, stamps, digits):
    rows = (f"{stamp:.{digits}f},{k % 7},{k * k % 11}" for k, stamp in enumerate(stamps))
    return "\n".join([f"{name},u,y", *rows])


def read(tmp_path, name, stamps, digits=9, **options):
    (tmp_path / "r.csv").write_text(table(name, stamps, digits))
    return read_record(tmp_path / "r.csv", ["u"], "y", **options)


def days(origin, step):
    """Return days since an origin, of samples that are ``step`` seconds apart."""
    return [(NOON + timedelta(seconds=step * k) - origin) / timedelta(days=1) for k in range(SAMPLES)]


EXCEL, MAC = datetime(1899, 12, 30), datetime(1904, 1, 1)


@pytest.mark.parametrize("name", ["Date", "Time", "Timestamp", "Datum", "time_excel", "t"])
def test_days_of_excel_at_one_minute_are_not_seconds(tmp_path, name):
    record = read(tmp_path, name, days(EXCEL, 60))
    assert record.dt == 60.0
    (note,) = record.reading
    assert note.startswith(f"column {name} is read as days: 45987.5 is 2025-11-26 12:00:00 (Excel); ")
    assert "give it the time unit s" in note


@pytest.mark.parametrize(
    ("first", "step", "digits"),
    [(45987.5, 0.01, 2), (32900.0, 1.0, 0), (45000.0, 0.5, 1), (727_000.0, 0.001, 3), (36000.0, 60.0, 0)],
)
def test_seconds_of_the_size_of_days_remain_seconds(tmp_path, first, step, digits):
    record = read(tmp_path, "time", first + step * K, digits)
    assert record.dt == pytest.approx(step)
    # Half a day and a day are usual steps as well.
    assert any("also possible as days" in note for note in record.reading) == (step in (0.5, 1.0))


@pytest.mark.parametrize(
    ("unit", "step"), [("s", 60 / 86_400), ("ms", 0.06 / 86_400), ("h", 2.5), ("d", 60.0), ("min", 60 / 1440)]
)
def test_a_given_unit_overrules_what_is_inferred(tmp_path, unit, step):
    record = read(tmp_path, "Date", 45987.5 + K / 1440, time_unit=unit)
    assert (record.dt, record.reading) == (pytest.approx(step, rel=1e-6), ())


@pytest.mark.parametrize(
    ("name", "step"),
    [
        ("t_d", 864.0),
        ("Time (days)", 864.0),
        ("Zeit in Tagen", 864.0),
        ("Zeit in Stunden", 36.0),
        ("Elapsed hours", 36.0),
        ("time min", 0.6),
        ("timeMs", 1e-5),
        ("elapsedMillis", 1e-5),
        ("TimeSeconds", 0.01),
        ("time_microseconds", 1e-8),
        ("Time stamp", 0.01),
        ("TimeStamp", 0.01),
        ("TIME", 0.01),
    ],
)
def test_units_of_time_are_symbols_and_words(tmp_path, name, step):
    assert read(tmp_path, name, 0.01 * K, 2).dt == pytest.approx(step)
    assert read(tmp_path, name, 0.01 * K, 2, time=name).dt == pytest.approx(step)


@pytest.mark.parametrize(
    ("first", "unit", "step", "words"),
    [
        (1_764_158_400, 1.0, 0.5, "seconds of a date: 1764158400 is 2025-11-26 12:00:00 (Unix)"),
        (1_764_158_400_000, 1e-3, 0.25, "ms of a date: 1764158400000 is 2025-11-26 12:00:00 (Unix)"),
        (3_847_003_200, 1.0, 0.5, "seconds of a date: 3847003200 is 2025-11-26 12:00:00 (LabVIEW)"),
        (134_086_320_000_000_000, 1e-7, 0.1, "ticks of 100 ns of a date"),
        (638_997_552_000_000_000, 1e-7, 0.1, "ticks of 100 ns of a date"),
        (1_764_158_400_000_000_000, 1e-9, 0.1, "ns of a date"),
    ],
)
def test_counts_since_an_origin_are_recognised_by_their_size(tmp_path, first, unit, step, words):
    stamps = [first + step / unit * k for k in range(SAMPLES)]
    record = read(tmp_path, "Timestamp", stamps, 2 if unit == 1.0 else 0)
    assert record.dt == pytest.approx(step, rel=1e-6)
    assert words in record.reading[0]


def test_a_date_written_as_one_number_is_a_date(tmp_path):
    stamps = [float(f"{NOON + timedelta(seconds=10 * k):%Y%m%d%H%M%S}") for k in range(SAMPLES)]
    record = read(tmp_path, "Time", stamps, 0)
    assert (record.dt, record.start) == (10.0, 0.0)
    assert "YYYYMMDDhhmmss: 20251126120000" in record.reading[0]


@pytest.mark.parametrize("digits", [6, 10])
def test_times_of_day_of_a_spreadsheet_are_fractions_of_a_day(tmp_path, digits):
    record = read(tmp_path, "Time", 0.4375 + K / 1440, digits)
    assert record.dt == 60.0
    assert "read as fractions of a day: 0.4375 is 10:30:00 (Excel)" in record.reading[0]


@pytest.mark.parametrize(
    ("first", "step", "digits"), [(0.0, 1 / 1440, 9), (0.5, 0.001, 3), (0.1, 1 / 610.35, 9), (0.25, 0.005, 3)]
)
def test_a_short_time_in_seconds_is_no_time_of_day(tmp_path, first, step, digits):
    record = read(tmp_path, "Time", first + step * K, digits)
    assert (record.dt, record.reading) == (pytest.approx(step, rel=1e-4), ())


def test_time_stamps_have_no_unit(tmp_path):
    rows = ["time,u,y", *(f"12:00:{k % 60:02d}.{k},1,2" for k in range(40))]
    assert "column time holds time stamps" in refusal(tmp_path, rows, ("u",), "y", time_unit="d")


def test_a_unit_without_a_time_column_is_refused(tmp_path):
    rows = ["k,u,y", *(f"{k},{k % 7},{k % 5}" for k in range(40))]
    assert "no time column that time_unit= could describe" in refusal(
        tmp_path, rows, ("u",), "y", time_unit="d", dt=0.1
    )


def test_an_unknown_unit_is_refused(tmp_path):
    with pytest.raises(SettingsError, match="time_unit is one of s, ms, us, ns, min, h, d, got 'days'"):
        read(tmp_path, "t", K, time_unit="days")
    with pytest.raises(RecordError, match="time= and time_unit="):
        read(tmp_path, "t_weeks", K)
    assert read(tmp_path, "t_weeks", 7.0 * K, time="t_weeks", time_unit="d").dt == 604_800.0
