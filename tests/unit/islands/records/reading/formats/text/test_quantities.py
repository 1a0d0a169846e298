"""Cells with a number and a unit."""

import numpy as np
import pandas as pd
import pytest

import islands
from islands.errors import RecordError
from islands.records.reading import preview, read_record
from islands.records.reading.formats.text.quantities import split_quantity

U = np.random.default_rng(4).normal(size=60).round(3)


def write(tmp_path, cells, header="t_s;u;y"):
    rows = (f"{k / 10};{cell};{value}" for k, (cell, value) in enumerate(zip(cells, 2 * U, strict=True)))
    path = tmp_path / "r.csv"
    path.write_text("\n".join([header, *rows]))
    return path


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("0.86 V", ("0.86", "V")),
        ("86 %", ("86", "%")),
        ("1.2e-3 mm", ("1.2e-3", "mm")),
        ("-12,5kN", ("-12,5", "kN")),
        ("23.4°C", ("23.4", "°C")),
        ("3 Volt", ("3", "V")),
        ("400 ppm", ("400", "ppm")),
        *((text, None) for text in ("0.Name", "12:30 m", "0x1F", "2026-11-22 V", "V", "1.5", "1e3", "5x")),
    ],
)
def test_a_number_is_separated_from_its_unit(text, parts):
    found = split_quantity(text)
    assert found == parts if found is None else (found[0].strip(), found[1]) == parts


@pytest.mark.parametrize("unit", ["V", "%", "mm", "°C"])
def test_the_unit_of_the_cells_is_that_of_the_column(tmp_path, unit):
    path = write(tmp_path, [f"{value} {unit}" for value in U])
    record = read_record(path, ["u"], "y")
    np.testing.assert_array_equal(record.u[:, 0], U)
    assert record.input_units == (unit,)
    assert record.reading == (f"the unit of column u [{unit}] is read from its cells",)
    assert preview(path).columns[1].unit == unit


def test_units_with_other_prefixes_are_converted(tmp_path):
    cells = [f"{value:.3f} V" if abs(value) >= 1 else f"{1000 * value:.0f} mV" for value in U]
    record = read_record(write(tmp_path, cells, "t_s;u_V;y"), ["u_V"], "y")
    np.testing.assert_allclose(record.u[:, 0], U, atol=1e-12)
    assert "converted to V" in record.reading[0]


@pytest.mark.parametrize("cell", ["0.5 A", "0.5", "V"])
def test_a_cell_with_another_unit_or_none_is_refused(tmp_path, cell):
    cells = [f"{value} V" for value in U]
    cells[40] = cell
    with pytest.raises(RecordError, match="line 42, column u"):
        read_record(write(tmp_path, cells), ["u"], "y")


def test_the_texts_of_a_data_frame_are_read_as_cells():
    frame = pd.DataFrame({"u": [f"{value} V" for value in U], "y": 2 * U, "s": ["on", "off"] * 30})
    frame["y"] = frame["y"].astype(object)
    frame.loc[7, "y"] = "OL"
    record = islands.as_record(frame, dt=0.1, inputs=["u", "s"], output="y")
    assert record.input_units == ("V", "")
    np.testing.assert_array_equal(record.u, np.column_stack([U, [1, 0] * 30]))
    assert np.flatnonzero(np.isnan(record.y)).tolist() == [7]
    assert len(record.reading) == 3
