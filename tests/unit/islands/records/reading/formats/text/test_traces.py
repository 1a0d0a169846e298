"""Traces of controllers, with a block of samples for each variable."""

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import preview, read_record

K = np.arange(60)
U, Y = K % 7 - 3.0, K * K % 11 + 0.5
HEAD = "[key]; [value]\nVersion; 0x03050000\nName; Application.Trace\nComment; \n"


def block(place, name, times, values):
    samples = "".join(f"; {time}; {value}\n" for time, value in zip(times, values, strict=True))
    return f"{place}.Variable; {name}\n{place}.Class; 14\n{place}.YAxis; 0\n{place}.Data; \n{samples}"


def write(path, *blocks):
    path.write_text(HEAD + "".join(block(place, *each) for place, each in enumerate(blocks)))
    return path


@pytest.mark.parametrize("name", ["r.csv", "r.txt", "r.trace", "r"])
def test_the_variables_of_a_trace_are_columns(tmp_path, name):
    file = write(tmp_path / name, ("PLC_PRG.u", 20 * K, U), ("PLC_PRG.y", 20 * K, Y))
    record = read_record(file, ["PLC_PRG.u"], "PLC_PRG.y")
    assert record.dt == pytest.approx(0.02)
    assert np.array_equal(record.u[:, 0], U)
    assert np.array_equal(record.y, Y)
    assert record.reading == (
        f"{name} is a trace of a controller; its times are read in ms (option time_unit overrules it)",
    )
    assert preview(file).warnings == record.reading
    assert read_record(file, ["PLC_PRG.u"], "PLC_PRG.y", time_unit="us").dt == pytest.approx(2e-5)


def test_lines_of_a_trace_that_are_not_samples_are_ignored(tmp_path):
    file = write(tmp_path / "r.csv", ("u", [*20 * K, "nan", "x", "1e999"], [*U, 1, 2, 3]), ("y", 20 * K, Y))
    assert np.array_equal(read_record(file, ["u"], "y").u[:, 0], U)


def test_a_trace_without_samples_is_refused(tmp_path):
    with pytest.raises(RecordError, match=r"r\.csv is a trace without samples: export it again"):
        preview(write(tmp_path / "r.csv", ("u", [], []), ("y", [], [])))
