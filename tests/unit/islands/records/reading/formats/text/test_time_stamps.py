"""Time stamps of text tables: every common form gives elapsed seconds, or a refusal with its remedy."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from islands.records.reading import read_record
from support.bad_records import refusal

SAMPLES = 60
STEP = 0.25
START = datetime(2026, 11, 22, 23, 59, 50)


def table(stamps, header="Timestamp;u;y"):
    return [header, *(f"{stamp};{k % 7};{k % 11}" for k, stamp in enumerate(stamps))]


def read(tmp_path, rows, **options):
    path = tmp_path / "r.csv"
    path.write_text("\n".join(rows), encoding="utf-8")
    return read_record(path, ["u"], "y", **options)


def moments(start=START, step=STEP, samples=SAMPLES):
    return [start + timedelta(seconds=step * k) for k in range(samples)]


@pytest.mark.parametrize(
    "form",
    [
        "%Y-%m-%dT%H:%M:%S.%fZ",
        "%Y-%m-%d %H:%M:%S,%f",
        "%Y-%m-%d %H:%M:%S.%f+01:00",
        "%Y/%m/%d %H:%M:%S.%f",
        "%Y%m%dT%H%M%S.%f",
        "%d.%m.%Y %H:%M:%S,%f",
        "%d.%m.%y %H:%M:%S.%f",
        "%m/%d/%Y %I:%M:%S.%f %p",
        "%d/%m/%Y %H:%M:%S.%f",
        "%d-%m-%Y %H:%M:%S.%f",
        "%d-%b-%Y %H:%M:%S.%f",
        "%H:%M:%S.%f",
        "%H:%M:%S:%f",
    ],
)
def test_a_common_form_gives_elapsed_seconds_across_midnight(tmp_path, form):
    record = read(tmp_path, table(moment.strftime(form) for moment in moments()))
    assert record.dt == pytest.approx(STEP, rel=1e-12)
    assert (record.start, record.samples) == (0.0, SAMPLES)


def test_days_without_a_proof_of_their_order_are_refused_unless_it_is_given(tmp_path):
    rows = table(moment.strftime("%d/%m/%Y") for moment in moments(datetime(2026, 3, 4), 86400.0, 9))
    assert "column Timestamp: 04/03/2026 may be the day 04 of the month 03" in refusal(
        tmp_path, rows, ["u"], "y"
    )
    assert 'give dates="day-first" or dates="month-first"' in refusal(tmp_path, rows, ["u"], "y")
    rows = table(moment.strftime("%d/%m/%Y") for moment in moments(datetime(2026, 3, 4), 86400.0))
    assert read(tmp_path, rows, dates="day-first").dt == 86400.0
    assert read(tmp_path, rows).dt == 86400.0  # the 13th of March proves the order


@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M", "%m/%d/%y %I:%M:00 %p"])
def test_a_time_that_goes_on_at_midnight_proves_the_order(tmp_path, form):
    stamps = [moment.strftime(form) for moment in moments(datetime(2026, 1, 2), 3600.0, 120)]
    record = read(tmp_path, table(stamps))
    assert (record.dt, record.samples) == (3600.0, 120)


def test_contradicting_orders_are_refused_with_both_lines(tmp_path):
    rows = table([*(f"13/01/2026 10:00:{k:02d}" for k in range(30)), *["01/14/2026 10:00:00"] * 30])
    message = refusal(tmp_path, rows, ["u"], "y")
    assert "has the day first in bad.csv, line 2 and the month first in line 32" in message


def test_a_change_to_winter_time_is_refused_unless_the_time_zone_is_given(tmp_path):
    utc = [datetime(2026, 10, 25, 0, 30) + timedelta(minutes=k) for k in range(SAMPLES)]
    local = [moment + timedelta(hours=2 if moment.hour < 1 else 1) for moment in utc]
    rows = table(moment.strftime("%Y-%m-%d %H:%M") for moment in local)
    message = refusal(tmp_path, rows, ["u"], "y")
    assert "line 32, column Timestamp jumps back" in message
    assert 'if it is the end of summer time, give the time zone, as timezone="Europe/Berlin"' in message
    assert read(tmp_path, rows, timezone="Europe/Berlin").dt == 60.0


def test_a_change_to_summer_time_is_refused_unless_the_time_zone_is_given(tmp_path):
    utc = [datetime(2026, 3, 29, 0, 30) + timedelta(minutes=k) for k in range(SAMPLES)]
    local = [moment + timedelta(hours=1 if moment.hour < 1 else 2) for moment in utc]
    rows = table(moment.strftime("%Y-%m-%d %H:%M") for moment in local)
    assert 'beginning of summer time, give the time zone, as timezone="Europe' in refusal(
        tmp_path, rows, ["u"], "y"
    )
    assert read(tmp_path, rows, timezone="Europe/Berlin").dt == 60.0


@pytest.mark.parametrize("stamp", ["2026-02-30 10:00:00", "25.13.2026 10:00", "13:00 PM", "2026-11-22 25:00"])
def test_an_impossible_stamp_is_named(tmp_path, stamp):
    stamps = [moment.strftime("%Y-%m-%d %H:%M:%S.%f") for moment in moments()]
    stamps[40] = stamp
    message = refusal(tmp_path, table(stamps), ["u"], "y")
    assert f"bad.csv, line 42, column Timestamp: '{stamp}' is not a time stamp" in message


def test_a_missing_stamp_is_left_out_with_gaps(tmp_path):
    stamps = [moment.strftime("%H:%M:%S.%f") for moment in moments()]
    stamps[20] = ""
    assert "line 22, column Timestamp is empty" in refusal(tmp_path, table(stamps), ["u"], "y")
    record = read(tmp_path, table(stamps), gaps="interpolate")
    assert (record.samples, record.u[20, 0]) == (SAMPLES, np.mean([19 % 7, 21 % 7]))
    assert record.reading[0] == "left out: 1 row without a time, the first is line 22"
