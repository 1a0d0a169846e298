"""Rows that are not samples: footers, repeated headers, properties of oscilloscopes."""

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import preview, read_record
from support.bad_records import lines

HEAD, *ROWS = lines()


def write(tmp_path, *rows):
    path = tmp_path / "r.csv"
    path.write_text("\n".join(rows))
    return path


@pytest.mark.parametrize(
    "footer",
    [
        ["", "Mean,0.1,0.2", "Max,1,2", "Signed: A. Smith"],
        ["", "", "Checksum: 0xA5F3", "", "Operator,X"],
        ["", ",0.1,0.2", ",1,2", "mean and largest value"],
        ["END OF DATA"],
        ["Mittelwert,0.1,0.2"],
        ["# logger stopped by the user"],
    ],
)
def test_a_footer_is_left_out_and_stated(tmp_path, footer):
    path = write(tmp_path, HEAD, *ROWS, *footer)
    record = read_record(path, ["u_V"], "y_um")
    assert record.samples == len(ROWS)
    assert "below the samples" in record.reading[0]
    assert str(len(ROWS) + 2) in record.reading[0]
    assert record.reading[0] in preview(path).warnings


@pytest.mark.parametrize("rest", [["0.61,1.5"], ["abc,1,2"], ["", "0.61,1,2", "0.62,2,3"], ["", "0.61,1"]])
def test_a_damaged_last_line_and_a_second_recording_are_no_footer(tmp_path, rest):
    with pytest.raises(RecordError, match=r"r\.csv, line 6"):
        read_record(write(tmp_path, HEAD, *ROWS, *rest), ["u_V"], "y_um")


def shift(rows, seconds):
    return [f"{float(row.split(',')[0]) + seconds:.2f},{row.split(',', 1)[1]}" for row in rows]


@pytest.mark.parametrize(
    "between",
    [[HEAD], ["", "Logger 7 started", "Serial,123", HEAD], [HEAD, "s,V,um"], ["Mean,1,2", "", HEAD]],
)
@pytest.mark.parametrize("seconds", [-0.3, 100.0])
def test_a_header_after_a_restart_begins_a_segment(tmp_path, between, seconds):
    path = write(tmp_path, HEAD, *ROWS[:30], *between, *shift(ROWS[30:], seconds))
    record = read_record(path, ["u_V"], "y_um")
    whole = read_record(write(tmp_path, HEAD, *ROWS), ["u_V"], "y_um")
    assert record.segments == (30, len(ROWS) - 30)
    assert record.dt == pytest.approx(whole.dt)
    np.testing.assert_array_equal(record.y, whole.y)
    assert any("header is repeated" in note for note in record.reading)
    assert any("2 segments" in note for note in record.reading)


def test_gaps_are_repaired_within_each_recording(tmp_path):
    second = shift(ROWS[30:], 100.0)
    path = write(tmp_path, HEAD, *ROWS[:10], *ROWS[13:30], HEAD, *second)
    assert read_record(path, ["u_V"], "y_um", gaps="split").segments == (10, 17, len(second))
    assert read_record(path, ["u_V"], "y_um", gaps="interpolate").segments == (30, len(second))
