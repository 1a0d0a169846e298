"""Damaged or malicious MAT-files: each is refused with a message, before memory is allocated for it."""

import struct
import zlib

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import read_columns, read_record
from islands.records.reading.formats.mat.workspace import ADVICE
from islands.records.reading.size_limits import MOST_SAMPLES

K = np.arange(60)
U, Y = K % 7 - 3.0, K * K % 11 + 0.5

INT8, INT32, UINT32, DOUBLE, MATRIX, COMPRESSED = 1, 5, 6, 9, 14, 15
CLASSES = {"cell": 1, "struct": 2, "double": 6, "function_handle": 16}


def element(kind, content, size=None):
    """Write an element of version 5; ``size`` replaces the correct size."""
    written = struct.pack("<2I", kind, len(content) if size is None else size) + content
    return written + b"\0" * (0 if kind == COMPRESSED else -len(content) % 8)


def matrix(name, kind, shape, *parts, size=None):
    flags = element(UINT32, struct.pack("<2I", CLASSES[kind], 0))
    dimensions = element(INT32, struct.pack(f"<{len(shape)}i", *shape))
    return element(MATRIX, flags + dimensions + element(INT8, name.encode()) + b"".join(parts), size)


def numbers(name, values, shape=None, kind=DOUBLE, size=None):
    return matrix(name, "double", shape or (len(values), 1), element(kind, values.tobytes(), size))


def structure(name, **fields):
    table = b"".join(field.encode().ljust(32, b"\0") for field in fields)
    width = struct.pack("<2Hi", INT32, 4, 32)
    return matrix(name, "struct", (1, 1), width, element(INT8, table), *fields.values())


def opaque(name, kind):
    flags = element(UINT32, struct.pack("<2I", 17, 0))
    words = b"".join(element(INT8, word.encode()) for word in (name, "MCOS", kind))
    return element(MATRIX, flags + words + numbers("", np.array([3707764736.0, 2.0])))


def packed(variable):
    return element(COMPRESSED, zlib.compress(variable))


@pytest.fixture
def write(tmp_path):
    """Write a MAT-file of version 5 with u, y, Ts and further elements."""

    def write(*elements):
        header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x100) + b"IM"
        sound = numbers("u", U) + numbers("y", Y) + numbers("Ts", np.array([0.1]))
        (tmp_path / "bad.mat").write_bytes(header + sound + b"".join(elements))
        return tmp_path / "bad.mat"

    return write


@pytest.mark.parametrize("kind", ["timeseries", "timetable", "iddata", "mine"])
@pytest.mark.parametrize("wrapped", [bytes, packed])
def test_an_object_named_ts_is_refused_with_advice_only_when_read(write, kind, wrapped, refusal):
    file = write(wrapped(opaque("ts", kind)))
    assert read_record(file, ["u"], "y").dt == pytest.approx(0.1)
    message = refusal(file, ["ts"])
    assert f"bad.mat: column ts holds {kind} where real numbers are expected: save " in message
    assert ADVICE.get(kind, "one vector per channel").format(x="ts") in message


# Other formats and truncated files


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty: save it again"),
        (b"t,u,y\n", "is not a MAT-file"),
        (b"PK\x03\x04" + bytes(200), "is not a MAT-file"),
        (bytes(500), "is not a MAT-file"),
        (
            b"# Created by Octave 7.3.0\n# name: u\n",
            "is text in Octave's format: save it with save -v7 bad.mat",
        ),
        (b"\x89HDF\r\n\x1a\n" + bytes(500), "is damaged or truncated"),
    ],
)
def test_a_file_of_another_format_is_refused_with_its_format(tmp_path, content, words, refusal):
    (tmp_path / "bad.mat").write_bytes(content)
    assert f"bad.mat {words}" in refusal(tmp_path / "bad.mat")


@pytest.mark.parametrize("version", ["4", "6", "7", "7.3"])
def test_a_file_truncated_at_any_position_is_refused(save, version):
    variables = {"u": U, "y": Y} | ({} if version == "4" else {"s": {"a": U, "b": Y}})
    file = save(version, **variables, Ts=0.1)
    content = file.read_bytes()
    for length in range(1, len(content) - 1, 331 if version == "7.3" else 37):
        file.write_bytes(content[:length])
        with pytest.raises(RecordError, match=r"r\.mat"):
            read_record(file, ["u"], "y", dt=0.1)


def test_a_flipped_bit_in_compressed_numbers_affects_one_column_only(write, refusal):
    noise = np.random.default_rng(0).normal(size=500)
    variable = bytearray(packed(numbers("x", noise)))
    variable[-60] ^= 1
    file = write(bytes(variable))
    assert read_record(file, ["u"], "y").samples == len(U)
    assert "column x cannot be read" in refusal(file)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda stream: stream[:-4] + bytes(4), "incorrect data check"),
        (lambda stream: stream[:-9], "it declares 4056 bytes but contains a different number"),
    ],
)
def test_compressed_numbers_with_a_wrong_checksum_or_no_end_are_refused(write, change, words, refusal):
    variable = numbers("x", np.random.default_rng(0).normal(size=500))
    file = write(element(COMPRESSED, change(zlib.compress(variable))))
    assert read_record(file, ["u"], "y").samples == len(U)
    message = refusal(file)
    assert "column x cannot be read (" in message
    assert words in message


def test_more_compressed_bytes_than_declared_are_refused(write, refusal):
    file = write(element(COMPRESSED, zlib.compress(numbers("x", U) + bytes(8))))
    assert "column x cannot be read (it declares 536 bytes but contains a different number)" in refusal(file)


def test_a_damaged_field_does_no_harm(write, refusal):
    file = write(structure("s", a=numbers("", Y, shape=(61, 1)), b=numbers("", U)))
    assert read_record(file, ["s.b"], "y").samples == len(U)
    assert "column s.a cannot be read (it declares the shape (61, 1)" in refusal(file, ["s.a"])


def test_the_nesting_of_structures_is_limited(write, refusal):
    nested = numbers("", U)
    for _ in range(100):
        nested = structure("", a=nested)
    message = refusal(write(structure("s", a=nested)), ["s"])
    assert "column s cannot be read (structures are nested more than 32 deep" in message


def test_a_file_with_too_many_variables_is_refused(write, monkeypatch, refusal):
    monkeypatch.setattr("islands.records.reading.size_limits.MOST_COLUMNS", 50)
    many = [numbers(f"v{index}", U) for index in range(48)]
    assert len(read_columns(write(*many[:47]))) == 50
    assert "bad.mat has more than 50 columns" in refusal(write(*many))


def test_a_shape_with_too_few_numbers_is_refused(write, refusal):
    for variable in (numbers("x", U, shape=(2**27, 1)), packed(numbers("x", U, shape=(2**27, 1)))):
        message = refusal(write(variable))
        assert "it declares the shape (134217728, 1) but has 60 numbers" in message


# Wrong sizes


@pytest.mark.parametrize("shape", [(2**28, 1), (2**31 - 1, 2**31 - 1)])
def test_a_sample_count_above_the_limit_is_refused(write, shape, refusal):
    message = refusal(write(numbers("x", U, shape=shape)))
    assert (
        f"column x declares {shape[0] * shape[1]} samples, but a record has at most {MOST_SAMPLES}" in message
    )


@pytest.mark.parametrize("shape", [(-60, 1), (60, -1), (60,)])
def test_impossible_dimensions_are_refused(write, shape, refusal):
    assert "an array has the dimensions" in refusal(write(numbers("x", U, shape=shape)))


def test_an_element_larger_than_its_parent_is_refused(write, refusal):
    assert "an element declares 2147483648 bytes" in refusal(write(numbers("x", U, size=2**31)))
    assert "an element declares 4000000000 bytes" in refusal(
        write(matrix("x", "double", (60, 1), element(DOUBLE, U.tobytes()), size=4_000_000_000))
    )


def test_a_short_element_has_at_most_four_bytes(write, refusal):
    dimensions = struct.pack("<2H", INT32, 8) + struct.pack("<2i", 60, 1)
    flags = element(UINT32, struct.pack("<2I", CLASSES["double"], 0))
    corrupt = element(MATRIX, flags + dimensions + element(INT8, b"x") + element(DOUBLE, U.tobytes()))
    assert "bad.mat is damaged or truncated (an element declares 8 bytes" in refusal(write(corrupt))


def test_a_size_above_the_compression_limit_is_refused(write, refusal):
    corrupt = matrix("x", "double", (2**20, 1), element(DOUBLE, U.tobytes(), 2**23), size=2**23 + 48)
    message = refusal(write(packed(corrupt)))
    assert "column x cannot be read (it declares 8388656 bytes, compressed to" in message


@pytest.mark.parametrize(
    ("place", "number"), [(0, 2000), (0, 60), (4, -60), (8, -1), (12, 2), (16, 1), (16, 2**20)]
)
def test_an_invalid_header_of_version_4_is_refused(save, place, number, refusal):
    """VAX byte orders, unknown types, negative dimensions, empty names."""
    file = save("4", u=U, y=Y)
    content = bytearray(file.read_bytes())
    content[place : place + 4] = struct.pack("<i", number)
    file.write_bytes(content)
    assert "r.mat is not a MAT-file" in refusal(file)
    second = content[: len(content) // 2]
    file.write_bytes(save("4", u=U, y=Y).read_bytes()[: len(second)] + content)
    assert "r.mat is damaged or truncated (no variable begins at byte" in refusal(file)
