"""Encoding of a text file: a byte order mark, UTF-8, or an older encoding."""

import codecs
import re

from islands.errors import RecordError

#: Byte order marks and encodings that remove them. UTF-32 precedes UTF-16, whose mark begins in the same way.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)

#: Encoding of Windows in Western Europe and America.
_WESTERN = "cp1252"

#: Number of non-ASCII bytes that are too few for a detection, and their largest share among the letters and
#: digits of Western text. A header in Cyrillic has a share of 1.
_FEW, _LARGEST_WESTERN_SHARE = 4, 0.3

#: Bytes that decide between encodings without a byte order mark.
_SAMPLE = 1 << 16


def decode(content: bytes, file: str) -> tuple[str, str]:
    """Decode the content of a text file.

    Parameters
    ----------
    content : bytes
    file : str
        Name of the file, for the message.

    Returns
    -------
    text : str
    encoding : str
        Name of the encoding; empty for UTF-8.

    Raises
    ------
    RecordError
        The file is not text, or no encoding decodes it.
    """
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            return _decode_as(encoding, content, file), "" if mark == codecs.BOM_UTF8 else encoding
    if b"\0" not in content[:_SAMPLE]:
        try:
            return content.decode("utf-8"), ""
        except UnicodeDecodeError:
            pass
    encoding = _detect(content, file)
    return _decode_as(encoding, content, file), encoding


def _detect(content: bytes, file: str) -> str:
    """Return the encoding of text that is not UTF-8."""
    from charset_normalizer import from_bytes, is_binary  # noqa: PLC0415 - most files do not need it

    if is_binary(content[:_SAMPLE]):
        raise RecordError(f"{file} is not a text file: export the record as text, or give it its own suffix")
    if (
        b"\0" in content[:_SAMPLE]
    ):  # UTF-16 without a byte order mark: every second byte of ASCII text is zero
        return "utf-16-le" if content[1:2] == b"\0" else "utf-16-be"
    # Statistics of languages do not apply to a few symbols: those of ``y_µm`` are detected as Japanese.
    marked = b"\n".join(line for line in content.splitlines() if re.search(rb"[\x80-\xff]", line))[:_SAMPLE]
    others, ascii_count = len(re.findall(rb"[\x80-\xff]", marked)), len(re.findall(rb"\w", marked))
    is_western = others < _FEW or others <= _LARGEST_WESTERN_SHARE * (others + ascii_count)
    best = None if is_western else from_bytes(marked).best()
    return _WESTERN if best is None else best.encoding


def _decode_as(encoding: str, content: bytes, file: str) -> str:
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise RecordError(
            f"{file}, line {line}: byte 0x{content[error.start]:02x} at position {error.start} is not "
            f"{encoding.removesuffix('-sig').upper()}: save the file as UTF-8"
        ) from error
