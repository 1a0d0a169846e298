"""The format of a file by its content."""

import shutil

import numpy as np
import pytest
from openpyxl import Workbook

from islands.errors import RecordError
from islands.records.reading import preview, read_record
from support.bad_records import lines

TABLE = "\n".join(line.replace(",", "\t") for line in lines())


@pytest.mark.parametrize("name", ["r.log", "r.prn", "r", "r.2026-11-22", "r.xls", "r.xlsx", "r.mat", "r.npz"])
def test_a_table_of_text_is_read_whatever_its_ending(tmp_path, name):
    (tmp_path / name).write_text(TABLE)
    record = read_record(tmp_path / name, ["u_V"], "y_um")
    assert record.samples == len(lines()) - 1
    stated = f"{name} is text and is read as a table of text" in preview(tmp_path / name).warnings
    assert stated == name.endswith((".xls", ".xlsx", ".mat", ".npz"))


@pytest.mark.parametrize("name", ["r.xls", "r", "r.csv"])
def test_a_workbook_and_arrays_are_found_by_their_content(tmp_path, name):
    book = Workbook()
    for line in lines():
        cells = line.split(",")
        book.active.append([float(cell) if cell[0].isdigit() or cell[0] == "-" else cell for cell in cells])
    book.save(tmp_path / "book.xlsx")
    shutil.copy(tmp_path / "book.xlsx", tmp_path / name)
    assert read_record(tmp_path / name, ["u_V"], "y_um").samples == len(lines()) - 1
    values = np.random.default_rng(1).normal(size=60)
    np.savez(tmp_path / "array.npz", u=values, y=values, dt=0.1)
    shutil.copy(tmp_path / "array.npz", tmp_path / name)
    assert read_record(tmp_path / name, ["u"], "y").samples == 60


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600), "Excel 97 to 2003"),
        (b"<html><table><tr><td>1</td></tr></table></html>", "contains HTML or XML"),
        (b'<?xml version="1.0"?>\n<Workbook/>', "contains HTML or XML"),
        (bytes(range(256)), "are not supported"),
        (b"a letter\nof two lines\n", "are not supported"),
    ],
)
def test_another_content_is_refused_with_its_remedy(tmp_path, content, words):
    (tmp_path / "r.xls").write_bytes(content)
    with pytest.raises(RecordError, match=words):
        read_record(tmp_path / "r.xls", ["u_V"], "y_um")
