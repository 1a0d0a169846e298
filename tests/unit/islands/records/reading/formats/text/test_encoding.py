"""Text in common encodings is decoded, and what is not text is refused."""

import codecs

import pytest

from islands.errors import RecordError
from islands.records.reading.formats.text.encoding import decode

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


def test_a_binary_file_is_refused():
    with pytest.raises(RecordError, match=r"a\.csv is not a text file: export the record as text"):
        decode(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(range(256)), "a.csv")
    with pytest.raises(
        RecordError, match=r"line 1: byte 0x\w\w at position \d+ is not UTF-16: save the file"
    ):
        decode(codecs.BOM_UTF16_LE + b"t\0;\0\0\xd8u\0", "a.csv")
