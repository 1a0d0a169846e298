"""Tables whose newest row is the first one are read in the order of their times."""

import numpy as np
import pytest

from islands.records.reading import preview, read_record
from support.odd_files import U, Y, stamps, table

NOTE = "the rows are read from the last to the first, because their time decreases"


def write(path, header, times):
    lines = table(header, times=times).splitlines()
    path.write_text("\n".join([lines[0], *lines[:0:-1]]) + "\n")
    return path


@pytest.mark.parametrize(
    ("header", "times"),
    [
        ("t_s,u_V,y_um", None),
        ("timestamp,u_V,y_um", stamps("%Y-%m-%dT%H:%M:%S.%fZ")),
        ("When,u_V,y_um", stamps("%m/%d/%Y %I:%M:%S.%f %p")),
        ("Uhrzeit,u_V,y_um", stamps("%H:%M:%S.%f")),
        ("Date,Time,u_V,y_um", stamps("%d.%m.%Y,%H:%M:%S.%f")),
    ],
)
def test_rows_with_decreasing_times_are_read_from_the_last_to_the_first(tmp_path, header, times):
    file = write(tmp_path / "r.csv", header, times)
    record = read_record(file, ["u_V"], "y_um")
    assert record.dt == pytest.approx(0.01)
    assert np.array_equal(record.u[:, 0], U)
    assert np.array_equal(record.y, Y)
    assert record.reading == (NOTE,)
    assert NOTE in preview(file).warnings
    assert np.array_equal(read_record(file, ["u_V"], "y_um", rows=slice(5, 40)).y, Y[5:40])


def test_rows_with_increasing_times_keep_their_order(tmp_path):
    (tmp_path / "r.csv").write_text(table())
    assert read_record(tmp_path / "r.csv", ["u_V"], "y_um").reading == ()
