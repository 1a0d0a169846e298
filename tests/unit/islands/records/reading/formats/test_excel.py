"""Workbooks: the sheet with the table is found, and one without a table is named."""

import pytest
from openpyxl import Workbook

from islands.errors import RecordError
from islands.records.reading import preview, read_record
from islands.records.reading.options import ReadingOptions

ROWS = [(k / 10, k % 7, k * k % 11) for k in range(60)]


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a workbook with a sheet of text and given sheets of samples."""

    def make(*sheets):
        book = Workbook()
        book.active.title = "Info"
        book.active.append(["Operator", "A. Bee"])
        book.active.append(["Bench", 3])
        for name in sheets:
            sheet = book.create_sheet(name)
            for row in (("t_s", "u", "y"), *ROWS):
                sheet.append(row)
        book.save(tmp_path / "a.xlsx")
        return tmp_path / "a.xlsx"

    return make


def test_the_first_sheet_with_a_table_is_read_and_the_others_are_named(write):
    path = write("Data", "More")
    assert read_record(path, ["u"], "y").samples == len(ROWS)
    assert preview(path).warnings == ("the sheet Data of a.xlsx is read; other sheets (sheet=): Info, More",)


@pytest.mark.parametrize(
    ("sheets", "words"),
    [
        (("Data",), "the sheet Info of a.xlsx has no table of numbers; sheets with one are Data"),
        (("Data", "More"), "sheets with one are Data, More"),
        ((), "the sheet Info of a.xlsx has no table of numbers; no other sheet has one"),
    ],
)
def test_a_given_sheet_without_a_table_is_named_with_those_that_have_one(write, sheets, words):
    """The message was that the workbook has no sheet with a table."""
    with pytest.raises(RecordError, match=words):
        preview(write(*sheets), ReadingOptions(sheet="Info"))
