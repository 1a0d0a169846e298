"""Text in common encodings is decoded, and what is not text is refused."""

import codecs

import pytest

from islands.errors import RecordError
from islands.records.reading import preview, read_record
from islands.records.reading.formats.text.encoding import decode
from support.bad_records import changed, refusal

WESTERN = "t [s];u [V];y [µm];Größe (m/s²);Temperatur [°C]\n0,1;1;2;3;4\n"
CYRILLIC = "Время;Напряжение;Скорость\n0;1;2\n"


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        *((WESTERN, name) for name in ("utf-8", "utf-8-sig", "cp1252", "latin-1", "utf-16", "utf-32")),
        *((WESTERN, name) for name in ("utf-16-le", "utf-16-be")),
        (CYRILLIC, "cp1251"),
        ("時間;電圧;速度\n0;1;2\n", "shift_jis"),
    ],
)
def test_decoded_text_equals_the_written_text(text, encoding):
    decoded, name = decode(text.encode(encoding), "a.csv")
    assert decoded == text
    assert bool(name) == (not encoding.startswith("utf-8"))


def test_text_in_utf_16_of_either_order_is_marked():
    for mark, order in ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be")):
        assert decode(mark + WESTERN.encode(order), "a.csv") == (WESTERN, "utf-16")


def test_a_binary_file_is_refused():
    with pytest.raises(RecordError, match=r"a\.csv is not a text file: export the record as text"):
        decode(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(range(256)), "a.csv")
    with pytest.raises(
        RecordError, match=r"line 1: byte 0x\w\w at position \d+ is not UTF-16: save the file"
    ):
        decode(codecs.BOM_UTF16_LE + b"t\0;\0\0\xd8u\0", "a.csv")


def test_the_encoding_of_a_file_is_stated(tmp_path):
    rows = [line.replace("y_um", "y [µm]") for line in changed(1, 1, "u_V")]
    path = tmp_path / "western.csv"
    path.write_bytes("\n".join(rows).encode("cp1252"))
    assert read_record(path, "u_V", "y [µm]").output_unit == "µm"
    assert "western.csv is not UTF-8 and is read as cp1252" in preview(path).warnings


def test_an_invalid_cell_in_another_encoding_is_named(tmp_path):
    message = refusal(tmp_path, "\n".join(changed(3, 1, "5µ")).encode("latin-1"))
    assert "bad.csv, line 3, column u_V: '5µ' is not a number" in message
