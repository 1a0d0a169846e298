"""Words for a missing value, as loggers, spreadsheets and control systems write them."""

import numpy as np
import pytest

from islands.errors import RecordError, SettingsError
from islands.records.reading import preview, read_record
from islands.records.reading.formats.text.missing_words import is_missing
from islands.records.reading.options import ReadingOptions
from support.bad_records import lines

#: Words of meters, loggers, spreadsheets in eight languages, printf, historians and databases.
WORDS = (
    *(
        "OL",
        "0L",
        "-OL",
        "+OVER",
        "O.L.",
        "BURNOUT",
        "Over Range",
        "OPEN",
        "*****",
        "-----",
        "+++++",
        "?",
        "∞",
        "-∞",
    ),
    *("#DIV/0!", "#NV", "#WERT!", "#VALEUR!", "#¡DIV/0!", "#DEEL/0!", "#ИМЯ?", "#Н/Д", "Err:502"),
    *("-1.#IND", "1.#QNAN", "1,#QNAN0", "-nan(ind)", "nan(snan)", "########"),
    *("Bad Input", "BAD_INPUT", "No Data", "I/O Timeout", "Comm Fail", "unavailable", "Pt Created"),
    *("[-11059] No Good Data For Calculation", "<NA>", "Überlauf", "Fehler", "erreur", "sin datos"),
)


def write(tmp_path, words, column=2):
    """Write a record of 60 samples in which the cells of a column in lines 12, 13, ... are words."""
    rows = [line.split(",") for line in lines()]
    for at, word in enumerate(words, 11):
        rows[at][column] = word
    path = tmp_path / "r.csv"
    path.write_text("\n".join(";".join(row) for row in rows))
    return path


@pytest.mark.parametrize("word", WORDS)
def test_a_word_of_a_logger_is_a_missing_value(tmp_path, word):
    path = write(tmp_path, [word, word])
    record = read_record(path, ["u_V"], "y_um")
    assert np.flatnonzero(np.isnan(record.y)).tolist() == [10, 11]
    note = f"column y_um: {word} is read as missing in 2 cells, the first in line 12"
    assert record.reading == (note,)
    assert note in preview(path).warnings


@pytest.mark.parametrize("word", ["u_V", "12.5", "1e3", "Time", "2026-11-22", "#1", "Good", "run 3", "Pa"])
def test_a_name_a_number_and_a_unit_are_not_missing(word):
    assert not is_missing(word)


def test_words_of_the_user_are_missing_values(tmp_path):
    path = write(tmp_path, ["Sensor 3 tot", "-9999", "-9999.00"])
    with pytest.raises(RecordError, match=r"'Sensor 3 tot' is not a number.*missing"):
        read_record(path, ["u_V"], "y_um")
    record = read_record(path, ["u_V"], "y_um", missing=["sensor 3 tot", "-9999"])
    assert np.flatnonzero(np.isnan(record.y)).tolist() == [10, 11, 12]
    assert any("-9999" in note for note in record.reading)


def test_an_empty_word_is_refused():
    with pytest.raises(SettingsError, match="empty"):
        ReadingOptions(missing=("OL", " "))
