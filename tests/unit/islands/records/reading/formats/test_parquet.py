"""Parquet files: types of numbers, times in the unit of their name, and checks of declared sizes."""

import struct
from decimal import Decimal

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from islands.errors import RecordError
from islands.records.reading import read_columns, read_record
from islands.records.reading.size_limits import MOST_SAMPLES

SAMPLES = 60
K = np.arange(SAMPLES)
U, Y, T = K % 7 - 3.0, K * K % 11 + 0.5, K / 8


@pytest.fixture
def write(tmp_path):
    """Write t_s, u_V and y_um, which may be replaced or dropped, and further columns."""

    def write(options=None, drop=(), **columns):
        table = pa.table({"t_s": T, "u_V": U, "y_um": Y} | columns).drop_columns(list(drop))
        parquet.write_table(table, tmp_path / "r.parquet", **(options or {}))
        return tmp_path / "r.parquet"

    return write


def refusal(file, inputs=("u_V",), output="y_um", **options):
    with pytest.raises(RecordError) as caught:
        read_record(file, inputs, output, **options)
    return str(caught.value)


@pytest.mark.parametrize(
    "options", [{}, {"row_group_size": 7}, {"compression": "zstd", "use_dictionary": False}]
)
def test_columns_are_read_with_names_units_and_times(write, options):
    record = read_record(write(options), ["u_V"], "y_um", rows=slice(8, None))
    assert read_columns(write()) == ("t_s", "u_V", "y_um")
    assert record.u[:, 0].tolist() == U[8:].tolist()
    assert record.y.tolist() == Y[8:].tolist()
    assert (record.dt, record.start) == (0.125, 1.0)
    assert (record.input_units, record.output_unit) == (("V",), "um")


@pytest.mark.parametrize(
    "column",
    [
        pa.array(K.tolist(), pa.int8()),
        pa.array(K.tolist(), pa.uint64()),
        pa.array(K.astype(np.float16)),
        pa.array(K.astype(np.float32)),
        pa.array([Decimal(int(k)) for k in K], pa.decimal128(9, 3)),
        pa.array(K.tolist(), pa.int64()).dictionary_encode(),
    ],
    ids=lambda column: str(column.type),
)
def test_numbers_of_every_kind_become_double_precision(write, column):
    assert read_record(write(u_V=column), ["u_V"], "y_um").u[:, 0].tolist() == K.tolist()


@pytest.mark.parametrize("kind", [pa.float64(), pa.int32(), pa.decimal128(9, 3)])
def test_a_null_is_a_missing_value(write, kind):
    column = pa.array([None if k == 17 else k for k in K.tolist()], kind)
    assert "r.parquet, sample 17, column u_V is empty or NaN" in refusal(write(u_V=column))
    record = read_record(write(y_um=column), ["u_V"], "y_um", missing_output=True)
    assert np.flatnonzero(np.isnan(record.y)).tolist() == [17]


@pytest.mark.parametrize(
    "column",
    [["mild"] * SAMPLES, [[1.0]] * SAMPLES, [{"re": 1.0}] * SAMPLES, [b"\x01"] * SAMPLES],
    ids=["text", "list", "struct", "bytes"],
)
def test_a_column_of_another_type_is_refused_only_when_it_is_read(write, column):
    file = write(note=column)
    assert read_record(file, ["u_V"], "y_um").samples == SAMPLES
    kind = parquet.read_schema(file).field("note").type
    if column[0] == "mild":
        kind = "text ('mild' in sample 0)"
    assert refusal(file, ["note"]) == f"r.parquet: column note holds {kind} where real numbers are expected"


# Times


TICKS = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}


def stamps(unit, step=0.125, zone=None):
    """Return points in time from 2023-11-14 on with a step in seconds."""
    ticks = [1_700_000_000 * TICKS[unit] + round(k * step * TICKS[unit]) for k in range(SAMPLES)]
    return pa.array(ticks, pa.timestamp(unit, zone))


def timed(write, name, column):
    return write(**{name: column}, drop=[] if name == "t_s" else ["t_s"])


@pytest.mark.parametrize("name", ["time", "timestamp", "t_s", "t_ms", "time_h"])
@pytest.mark.parametrize(
    "column", [stamps("ms"), stamps("us", zone="Europe/Berlin"), stamps("ns", zone="UTC")]
)
def test_points_in_time_are_relative_to_the_first_in_any_unit(write, name, column):
    record = read_record(timed(write, name, column), ["u_V"], "y_um", rows=slice(8, None))
    assert record.dt == pytest.approx(0.125)
    assert record.start == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("kind", "step"),
    [
        (pa.duration("us"), 125_000),
        (pa.time32("ms"), 125),
        (pa.time64("ns"), 125_000_000),
    ],
    ids=str,
)
def test_durations_and_times_of_day_are_times(write, kind, step):
    column = pa.array([int(k) * step + 10 * step for k in K], kind)
    record = read_record(timed(write, "t_ms", column), ["u_V"], "y_um")
    assert (record.dt, record.start) == (pytest.approx(0.125), pytest.approx(1.25))


# Damaged files, wrong sizes, and the optional dependency


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "r.parquet is empty"),
        (b"t,u\n" * 60, "r.parquet is damaged or not a Parquet file"),
        (b"PAR1" + bytes(90) + b"PAR1", "r.parquet is damaged or not a Parquet file"),
    ],
)
def test_a_file_of_another_format_is_refused(tmp_path, content, words):
    (tmp_path / "r.parquet").write_bytes(content)
    assert words in refusal(tmp_path / "r.parquet")


def test_a_file_truncated_at_any_position_is_refused(write):
    file = write()
    content = file.read_bytes()
    for length in range(1, len(content) - 1, 97):
        file.write_bytes(content[:length])
        assert "r.parquet is damaged or not a Parquet file" in refusal(file)


def varint(number):
    """Encode an integer like the footer: zigzag, seven bits per byte."""
    number *= 2
    written = b""
    while number > 127:
        written += bytes([number & 127 | 128])
        number >>= 7
    return written + bytes([number])


def claiming(file, rows, everywhere=True):
    """Replace the number of rows in the footer: everywhere, or only the first one, for the whole file."""
    content = file.read_bytes()
    length = struct.unpack("<I", content[-8:-4])[0]
    footer = content[-8 - length : -8].replace(varint(1234), varint(rows), -1 if everywhere else 1)
    file.write_bytes(content[: -8 - length] + footer + struct.pack("<I", len(footer)) + b"PAR1")


@pytest.fixture
def honest(tmp_path):
    k = np.arange(1234)
    table = pa.table({"t": k * 0.1, "u": k % 7 * 1.0, "y": k % 11 * 1.0})
    parquet.write_table(table, tmp_path / "r.parquet", write_statistics=False, store_schema=False)
    return tmp_path / "r.parquet"


@pytest.mark.parametrize("rows", [1235, 2**26])
def test_missing_rows_are_refused_without_allocating_memory(honest, rows):
    claiming(honest, rows)
    pool = pa.default_memory_pool()
    before = pool.max_memory()
    assert f"r.parquet declares {rows} rows and stores" in refusal(honest, ["u"], "y")
    assert pool.max_memory() - before < 2**23


def test_a_row_count_above_the_limit_is_refused(honest):
    claiming(honest, 2**40)
    message = refusal(honest, ["u"], "y")
    assert f"column u declares {2**40} samples, but a record has at most {MOST_SAMPLES}" in message
