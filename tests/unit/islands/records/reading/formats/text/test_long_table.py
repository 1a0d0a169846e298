"""Tables with one value in each row are recognised, and the preview says what to do."""

import pytest

from islands.records.reading import preview
from islands.records.reading.formats.text.long_table import describe_long_table

LONG = [
    *(f"2026-11-01T00:00:{k % 60:02d}Z,sensor.level,{0.8 + 0.01 * (k % 7)},m" for k in range(60)),
    *(f"2026-11-01T00:00:{k:02d}Z,sensor.flow,{k % 5},l/h" for k in range(0, 60, 2)),
]


def write(tmp_path, header, rows):
    path = tmp_path / "long.csv"
    path.write_text("\n".join([header, *rows]))
    return path


def test_a_long_table_is_named_with_the_column_of_the_signals(tmp_path):
    found = preview(write(tmp_path, "time,entity_id,state,unit", sorted(LONG)))
    text = next(each for each in found.warnings if "each row has the value of one signal" in each)
    assert "which column entity_id names (sensor.flow, sensor.level)" in text
    assert "the rows of one time, the columns of entity_id, the values of state" in text


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("time,mode,u,y", "{k},AUTO,{k},3"),
        ("time,mode,y", "{k},AUTO,3"),  # one word names no signals
        ("time,state,y", "{k},{state},3"),
        ("time,remark,y", "{k},remark {k},3"),  # every row has its own text
    ],
)
def test_a_table_with_a_column_for_each_signal_is_none(tmp_path, header, row):
    rows = [row.format(k=k, state=("on", "off")[k % 2]) for k in range(60)]
    names, cells = header.split(","), [each.split(",") for each in rows]
    assert describe_long_table(names, cells, "time") == ""
