"""Text tables without a valid record are refused with a message that says what to do."""

import numpy as np
import pytest

from islands.errors import SettingsError
from islands.records.reading import read_columns, read_record
from support.bad_records import changed, lines, refusal


@pytest.mark.parametrize("header", [[], [""]])
def test_a_file_without_a_header_is_refused(tmp_path, header):
    message = refusal(tmp_path, [*header, *lines()[1:]])
    assert f"bad.csv, line {len(header) + 1} contains the number 0 instead of a name" in message
    assert "add a header line" in message


@pytest.mark.parametrize("content", [b"", b"\xef\xbb\xbf", b"\n \n\r\n"])
def test_an_empty_file_is_refused(tmp_path, content):
    message = refusal(tmp_path, content)
    assert "bad.csv is empty" in message
    assert "a header with names and one line per sample" in message


@pytest.mark.parametrize("content", [b"t_s,u_V,y_um", b"t_s,u_V,y_um\r\n\r\n,,\r\n"])
def test_a_file_with_a_header_only_is_refused(tmp_path, content):
    message = refusal(tmp_path, content)
    assert "bad.csv has a header in line 1 but no samples" in message


def test_decimal_commas_and_points_in_one_file_are_refused(tmp_path):
    rows = ["t_s;u_V;y_um", *(f"{k / 100:.2f};{k % 7},5;{k % 11}" for k in range(60))]
    message = refusal(tmp_path, rows)
    assert "a decimal comma in bad.csv, line 2, column u_V (0,5)" in message
    assert "a decimal point in bad.csv, line 2, column t_s (0.00)" in message
    assert "the same mark" in message


def test_a_quote_that_is_never_closed_is_refused(tmp_path):
    message = refusal(tmp_path, changed(40, 1, '"3'))
    assert "is a quote never closed?" in message


def test_a_file_without_a_header_is_read_with_numbered_or_given_names(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("\n".join(["measured on bench 3", *lines()[1:]]))
    plain = read_record(path, ["c2"], "c3", dt=0.01, header=False)
    assert (plain.samples, plain.y[1]) == (60, 1.5)
    named = read_record(path, ["u_V"], "y_um", names=["t_s", "u_V", "y_um"])
    assert (named.dt, named.input_units) == (pytest.approx(0.01), ("V",))


def test_another_number_of_names_than_columns_is_refused(tmp_path):
    message = refusal(tmp_path, lines(), names=["t", "u"])
    assert "bad.csv, line 2 has 3 columns, and names= gives 2" in message


def test_options_of_tables_are_refused_for_arrays(tmp_path):
    np.savez(tmp_path / "r.npz", u=np.arange(60.0), y=np.arange(60.0))
    with pytest.raises(SettingsError, match=r"r\.npz is not a table of text: leave names out"):
        read_record(tmp_path / "r.npz", ["u"], "y", dt=1.0, names=["a", "b"])


def test_a_description_with_numbers_is_not_a_table(tmp_path):
    rows = [
        "Model,MDO3024",
        "Firmware,1.26",
        "Sample Interval,0.01",
        "Record Length,60",
        "Gain,1.5",
        "Zero,2",
    ]
    path = tmp_path / "r.csv"
    path.write_text("\n".join([*rows, "TIME,CH1", *(f"{k / 100:g},{k % 7}" for k in range(60))]))
    assert read_columns(path) == ("TIME", "CH1")


def test_a_long_line_is_refused(tmp_path):
    message = refusal(tmp_path, [*lines(), "1," * 500_001])
    assert "bad.csv, line 62 has 1000003 characters, and at most 1000000 are read" in message
