"""Numbers of text tables: decimal marks and separated thousands, or a refusal with its remedy."""

import numpy as np
import pytest

from islands.records.reading import preview, read_record
from support.bad_records import refusal

VALUES = 1234.5 + 7.25 * np.arange(60)


def table(cells, separator=";", time="{:.3f}"):
    rows = (separator.join((time.format(k / 100), str(k % 7), cell)) for k, cell in enumerate(cells))
    return [separator.join(("t_s", "u", "y")), *rows]


def grouped(value, thousands, mark):
    return f"{value:,.3f}".replace(",", "_").replace(".", mark).replace("_", thousands)


@pytest.mark.parametrize(
    ("thousands", "mark"),
    [
        (",", "."),
        (".", ","),
        (" ", ","),
        (" ", "."),
        ("'", "."),
        ("\u00a0", ","),
        ("\u202f", ","),
        ("’", "."),
    ],
)
def test_separated_thousands_are_read(tmp_path, thousands, mark):
    rows = table([grouped(value, thousands, mark) for value in VALUES])
    rows = [row if k == 0 or mark == "." else row.replace(".", ",", 1) for k, row in enumerate(rows)]
    path = tmp_path / "r.csv"
    path.write_text("\n".join(rows), encoding="utf-8")
    assert read_record(path, ["u"], "y").y.tolist() == VALUES.tolist()
    assert "is read with thousands separated" in preview(path).warnings[-1]


def test_numbers_with_two_readings_are_refused_unless_the_mark_is_given(tmp_path):
    rows = table([f"{k},{k:03d}" for k in range(1, 61)], "\t", "{:.0f}")
    message = refusal(tmp_path, rows, ["u"], "y", dt=0.01)
    assert "bad.csv, line 2, column y (1,001) may be 1001 or 1.001" in message
    assert 'give decimal="point" or decimal="comma"' in message
    (tmp_path / "r.csv").write_text("\n".join(rows))
    names = {"names": ["k", "u", "y"], "dt": 0.01}
    assert read_record(tmp_path / "r.csv", ["u"], "y", decimal="point", **names).y[0] == 1001.0
    assert read_record(tmp_path / "r.csv", ["u"], "y", decimal="comma", **names).y[0] == 1.001


def test_semicolons_tell_that_commas_are_decimal(tmp_path):
    (tmp_path / "r.csv").write_text("\n".join(table([f"{k},{k:03d}" for k in range(1, 61)], time="{:.0f}")))
    assert read_record(tmp_path / "r.csv", ["u"], "y", names=["k", "u", "y"], dt=1.0).y[1] == 2.002


def test_a_mark_that_contradicts_the_file_is_refused(tmp_path):
    message = refusal(tmp_path, table(["0.5", *"1" * 59]), ["u"], "y", decimal="comma")
    assert "line 2, column y (0.5) is not a number with the decimal mark ','" in message
