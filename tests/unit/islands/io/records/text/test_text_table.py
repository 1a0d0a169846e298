"""Text tables without a valid record are refused with a message that says what to do."""

import pytest

from support.bad_records import changed, lines, refusal


def test_a_header_without_names_is_refused(tmp_path):
    assert refusal(tmp_path, b",,\n,,\n").startswith("bad.csv has a header in line 1 but no samples")
    rows = [",,", *lines()[1:]]
    assert "bad.csv has no column u_V; it has (none with a name)" in refusal(tmp_path, rows)


@pytest.mark.parametrize("header", [[], [""]])
def test_a_file_without_a_header_is_refused(tmp_path, header):
    message = refusal(tmp_path, [*header, *lines()[1:]])
    assert f"bad.csv, line {len(header) + 1} contains the number 0 instead of a name" in message
    assert "add a header line" in message


def test_a_file_with_decimal_commas_and_no_header_is_refused(tmp_path):
    rows = [f"0,{k:03d};1,5;2,5" for k in range(60)]
    assert "line 1 contains the number 0,000" in refusal(tmp_path, rows)


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


def test_thousands_separators_are_refused(tmp_path):
    rows = ["t_s;u_V;y_um", *(f"{k};{k % 7};1.{k:03d},5" for k in range(60))]
    assert "line 2, column y_um: '1.000,5' is not a number" in refusal(tmp_path, rows)


def test_a_quote_that_is_never_closed_is_refused(tmp_path):
    message = refusal(tmp_path, changed(40, 1, '"3'))
    assert "is a quote never closed?" in message
