"""A column of milliseconds belongs to the time stamps next to it."""

import pytest

from islands.errors import RecordError
from islands.records.reading import read_record
from islands.records.reading.formats.text.milliseconds import find_milliseconds


def write(tmp_path, stamp, name="ms", last="200"):
    """Write a record of 60 samples of 0.2 s; the last stamp is followed by a cell."""
    rows = [f"{stamp.format(k // 5)},{200 * (k % 5)},{k % 7},{k % 11}" for k in range(59)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([f"Date&Time,{name},u,y", *rows, f"{stamp.format(11)},{last},1,2"]) + "\n")
    return path


@pytest.mark.parametrize("stamp", ["2024/05/14 09:12:{:02}", "09:12:{:02}", "5/14/2024 9:12:{:02} PM"])
@pytest.mark.parametrize("name", ["ms", "Millisecond"])
def test_milliseconds_are_added_to_whole_seconds(tmp_path, stamp, name):
    record = read_record(write(tmp_path, stamp, name, last="800"), ["u"], "y")
    assert record.dt == pytest.approx(0.2)
    assert len(record.y) == 60
    assert record.u[:, 0].tolist()[:3] == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("stamp", "part"), [("09:12:30.25", "250"), ("09:12:30", "1200"), ("09:12:30", "2.5"), ("09:12", "250")]
)
def test_other_columns_are_no_milliseconds(stamp, part):
    assert find_milliseconds(("t", "ms"), [[stamp, part]], {"t": ""}) == ""


def test_a_row_without_a_cell_of_each_column_is_refused_with_its_line(tmp_path):
    path = write(tmp_path, "09:12:{:02}")
    path.write_text(path.read_text() + "09:12:12,0,1\n")
    with pytest.raises(RecordError, match="line 62, column y: the line has 3 cells for 4 columns"):
        read_record(path, ["u"], "y")
