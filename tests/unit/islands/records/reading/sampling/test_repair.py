"""Irregular sampling: every defect is refused with its rows and remedy, and repaired by that remedy."""

import numpy as np
import pytest

from islands.records.reading import read_record
from support.bad_records import refusal

DT = 0.01
K = np.arange(400)
T = DT * K
U = np.sin(2 * np.pi * 2.0 * T)
Y = np.cos(2 * np.pi * 1.5 * T)


def rows(t=T, u=U, y=Y, digits=6):
    lines = (f"{a:.{digits}f},{b:.9f},{c:.9f}".replace("nan", "") for a, b, c in zip(t, u, y, strict=True))
    return ["t_s,u_V,y_um", *lines]


def read(tmp_path, table, **options):
    (tmp_path / "r.csv").write_text("\n".join(table))
    return read_record(tmp_path / "r.csv", ["u_V"], "y_um", **options)


def gone(table, *lines):
    return [row for number, row in enumerate(table, start=1) if number not in lines]


def blank(values, *samples):
    values = values.copy()
    values[list(samples)] = np.nan
    return values


def test_segments_may_begin_between_the_samples_of_the_grid(tmp_path):
    t = T + 0.1 + np.where(K >= 200, 0.0537, 0.0)
    record = read(tmp_path, rows(t), gaps="split")
    assert (record.segments, record.dt) == ((200, 200), pytest.approx(DT, rel=1e-9))
    assert "give resample=0.01" in refusal(tmp_path, rows(t), gaps="interpolate")


def test_gaps_are_interpolated_on_the_grid(tmp_path):
    record = read(tmp_path, gone(rows(), 50, 120, 121, 122), gaps="interpolate")
    assert (record.samples, record.segments) == (400, (400,))
    assert record.u[48, 0] == pytest.approx((U[47] + U[49]) / 2, abs=1e-8)
    assert np.abs(record.y - Y).max() < 5e-3
    assert "interpolated: 4 samples in 2 gaps, the longest of 0.04 before line 119" in record.reading[0]


def test_missing_values_are_named_interpolated_or_separate_segments(tmp_path):
    table = rows(u=blank(U, 100, 101), y=blank(Y, 300))
    message = refusal(tmp_path, table)
    assert "line 102, column u_V and 1 more of its cells are empty or NaN: give gaps=" in message
    filled = read(tmp_path, table, gaps="interpolate")
    assert np.abs(filled.u[:, 0] - U).max() < 2e-2
    assert filled.reading == ("interpolated: 3 missing values, the first in line 102",)
    split = read(tmp_path, table, gaps="split")
    assert split.segments == (100, 198, 99)
    assert split.reading[0] == "left out: 3 rows with missing values, the first is line 102"


def test_missing_values_at_the_ends_are_left_out(tmp_path):
    table = rows(u=blank(U, 0, 1, 399))
    record = read(tmp_path, table, gaps="interpolate")
    assert (record.samples, record.start) == (397, pytest.approx(0.02))
    assert record.reading[0] == "left out: 3 rows before the first or after the last value of a column"


def test_a_column_without_values_is_refused(tmp_path):
    message = refusal(tmp_path, rows(u=np.full(400, np.nan)), gaps="interpolate")
    assert "column u_V has no values" in message


def test_jitter_is_resampled_or_ignored(tmp_path):
    t = T + 0.002 * np.random.default_rng(1).uniform(-1, 1, 400)
    table = rows(t, np.sin(2 * np.pi * 2.0 * t), np.cos(2 * np.pi * 1.5 * t))
    message = refusal(tmp_path, table)
    assert "off the uniform grid" in message
    assert "resample=0.01" in message
    assert "dt=0.01" in message
    resampled = read(tmp_path, table, resample=DT)
    assert np.abs(resampled.u[:, 0] - np.sin(2 * np.pi * 2.0 * resampled.time)).max() < 5e-3
    assert resampled.reading[0] == "resampled to uniform steps of 0.01 s by linear interpolation"
    trusted = read(tmp_path, table, dt=DT)
    assert (trusted.samples, trusted.dt) == (400, DT)


def test_stamps_that_are_printed_too_coarsely_are_repeated_and_replaced_by_dt(tmp_path):
    table = rows(np.floor(T * 20 + 1e-9) / 20, digits=2)
    assert "repeats the time stamp 0 (320 of 400 rows do)" in refusal(tmp_path, table)
    assert "or, if only the printed time is too coarse, dt=DT" in refusal(tmp_path, table)
    assert read(tmp_path, table, dt=DT).dt == DT


def test_dt_does_not_hide_a_gap(tmp_path):
    assert "follows a gap" in refusal(tmp_path, gone(rows(), *range(100, 110)), dt=DT)


def test_repeated_rows_are_left_out_and_other_rows_of_equal_time_averaged(tmp_path):
    table = rows()
    doubled = [*table[:31], table[30], *table[31:]]
    assert "line 32, column t_s repeats the time stamp 0.29: give resample=" in refusal(tmp_path, doubled)
    record = read(tmp_path, doubled, gaps="split")
    assert np.array_equal(record.y, read(tmp_path, table).y)
    assert record.reading == ("left out: 1 repeated row, the first is line 32",)
    table[31] = table[30].rpartition(",")[0] + ",0.5"
    assert "repeats the time stamp" in refusal(tmp_path, table, gaps="split", outliers="keep")
    averaged = read(tmp_path, table, resample=DT, outliers="keep")
    assert averaged.y[29] == pytest.approx((Y[29] + 0.5) / 2, abs=1e-6)


def test_a_coarser_grid_is_filtered_against_folding(tmp_path):
    # 47 Hz folds to 3 Hz at 50 Hz; 2 Hz is kept.
    fast = np.sin(2 * np.pi * 47.0 * T)
    record = read(tmp_path, rows(u=U + fast), resample=0.04)
    kept = np.sin(2 * np.pi * 2.0 * record.time)
    inner = slice(10, -10)
    assert record.samples == 100
    assert np.abs(record.u[inner, 0] - kept[inner]).max() < 0.01
    assert record.reading[0].startswith("resampled from 0.01 s to 0.04 s by a linear-phase low-pass filter")


def test_resampling_does_not_cross_a_gap_unless_it_is_to_be_interpolated(tmp_path):
    table = gone(rows(), *range(100, 130))
    assert "follows a gap" in refusal(tmp_path, table, resample=0.02)
    split = read(tmp_path, table, resample=0.02, gaps="split")
    assert len(split.segments) == 2
    whole = read(tmp_path, table, resample=0.02, gaps="interpolate")
    assert whole.samples == 200
    assert "interpolated: a gap of 0.31 before line 100" in whole.reading[0]


def test_a_grid_with_too_many_samples_is_refused(tmp_path):
    assert "a uniform grid would have" in refusal(tmp_path, rows(), resample=1e-9)
