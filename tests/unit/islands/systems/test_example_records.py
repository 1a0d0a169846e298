"""Example records: the same at every call, of their law, and read from the file that is written."""

import numpy as np
import pytest

from islands.records.reading import read_record
from islands.records.writer import write_record
from islands.systems.example_records import EXAMPLE_RECORDS


@pytest.mark.parametrize("name", EXAMPLE_RECORDS)
def test_a_record_is_written_and_read_without_loss(name, tmp_path):
    made, again = EXAMPLE_RECORDS[name].make(), EXAMPLE_RECORDS[name].make()
    write_record(made, tmp_path / "r.csv")
    read = read_record(tmp_path / "r.csv", made.input_names, made.output_name)
    for other in (again, read):
        assert np.array_equal(made.u, other.u)
        assert np.array_equal(made.y, other.y)
    assert read.dt == pytest.approx(made.dt)
    assert (read.input_units, read.output_unit) == (made.input_units, made.output_unit)
    assert all((*made.input_units, made.output_unit))


def test_the_motor_has_dry_friction():
    record = EXAMPLE_RECORDS["motor"].make()
    u, y = record.u[:-1, 0], record.y[:-1]
    fast = np.abs(y) > 1.0
    terms = np.column_stack([y, u, np.sign(y)])[fast]
    theta = np.linalg.lstsq(terms, record.y[1:][fast], rcond=None)[0]
    assert theta == pytest.approx([0.95, 0.8, -0.9], abs=0.01)


def test_the_pipe_does_not_respond_for_twelve_samples():
    record = EXAMPLE_RECORDS["pipe"].make()
    assert np.abs(record.y[:12]).max() < 0.1
    assert record.y[13] - record.y[11] > 0.3
