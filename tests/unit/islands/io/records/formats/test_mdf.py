"""MDF files: the channels of a channel group with its times and units."""

import numpy as np
import pytest

from islands.errors import RecordError
from islands.io.records import preview, read_record

pytestmark = pytest.mark.ci  # asammdf is imported in two seconds

K = np.arange(60)


def test_a_channel_group_is_read_with_its_times_and_units(tmp_path):
    from asammdf import MDF, Signal

    path = tmp_path / "r.mf4"
    with MDF(version="4.10") as file:
        file.append([Signal(K % 7 - 3.0, K / 100, name="u", unit="V"), Signal(K % 11, K / 100, name="y")])
        file.append([Signal(np.arange(50.0), np.arange(50) / 10, name="speed", unit="rpm")] * 2)
        file.save(path, compression=2)
    record = read_record(path, ["u"], "y")
    assert (record.dt, record.input_units) == (pytest.approx(0.01), ("V",))
    assert record.u[:, 0].tolist() == (K % 7 - 3.0).tolist()
    assert "the group 0 of r.mf4 is read; other groups (--sheet): 1" in preview(path).warnings
    with pytest.raises(RecordError, match=r"r\.mf4 has no column speed.*other groups \(--sheet\): 1"):
        read_record(path, ["speed"], "y")
    path.write_bytes(b"MDF" + bytes(200))
    with pytest.raises(RecordError, match=r"r\.mf4 is damaged or not an MDF file"):
        read_record(path, ["u"], "y")
