"""MDF files: the channels of a channel group with its times and units."""

import gc
import re

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import preview, read_record

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
    assert "the group 0 of r.mf4 is read; other groups (sheet=): 1" in preview(path).warnings
    with pytest.raises(RecordError, match=r"r\.mf4 has no column speed.*other groups \(sheet=\): 1"):
        read_record(path, ["speed"], "y")
    path.write_bytes(b"MDF" + bytes(200))
    with pytest.raises(RecordError, match=r"r\.mf4 is damaged or not an MDF file"):
        read_record(path, ["u"], "y")


def test_a_sample_that_the_file_calls_invalid_is_missing(tmp_path):
    from asammdf import MDF, Signal

    path, invalid = tmp_path / "r.mf4", np.isin(K, (20, 41))
    y = np.where(invalid, 1e6, K % 11)
    with MDF(version="4.10") as file:
        file.append(
            [Signal(K % 7 - 3.0, K / 100, name="u"), Signal(y, K / 100, name="y", invalidation_bits=invalid)]
        )
        file.save(path)
    record = read_record(path, ["u"], "y", outliers="keep")
    assert np.flatnonzero(np.isnan(record.y)).tolist() == [20, 41]


def save(path):
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        file.append([Signal(K % 7 - 3.0, K / 100, name="u", unit="V"), Signal(K % 11, K / 100, name="y")])
        file.save(path)
    return path.read_bytes()


def test_a_file_truncated_at_any_position_is_refused_without_other_output(tmp_path, capfd):
    content = save(tmp_path / "whole.mf4")
    path = tmp_path / "r.mf4"
    for length in range(0, len(content) - 3000, 211):
        path.write_bytes(content[:length])
        with pytest.raises(RecordError) as caught:
            read_record(path, ["u"], "y")
        assert len(str(caught.value)) < 300
    gc.collect()
    assert capfd.readouterr() == ("", "")


def test_a_channel_outside_of_its_records_is_refused(tmp_path):
    content = save(tmp_path / "whole.mf4")
    path = tmp_path / "r.mf4"
    places = [found.start() + 92 for found in re.finditer(b"##CN", content)]
    assert len(places) == 3
    for place in places:
        path.write_bytes(content[:place] + (60_000).to_bytes(4, "little") + content[place + 4 :])
        with pytest.raises(RecordError, match=r"outside of the records of its group"):
            read_record(path, ["u"], "y")


@pytest.mark.timeout(60)
@pytest.mark.parametrize("mark", [b"##DG", b"##CG", b"##CN", b"##FH"])
def test_a_list_of_blocks_that_is_a_circle_is_refused(tmp_path, mark):
    content = bytearray(save(tmp_path / "whole.mf4"))
    at = content.index(mark)
    content[at + 24 : at + 32] = at.to_bytes(8, "little")
    (tmp_path / "r.mf4").write_bytes(content)
    with pytest.raises(RecordError, match=r"r\.mf4 is damaged \(a list of its blocks is a circle\)"):
        preview(tmp_path / "r.mf4")


@pytest.mark.timeout(60)
def test_a_circle_in_a_file_of_version_3_is_refused(tmp_path):
    from asammdf import MDF, Signal

    with MDF(version="3.30") as file:
        file.append([Signal(K % 7 - 3.0, K / 100, name="u", unit="V"), Signal(K % 11, K / 100, name="y")])
        file.save(tmp_path / "r.mdf")
    assert read_record(tmp_path / "r.mdf", ["u"], "y").samples == 60
    content = bytearray((tmp_path / "r.mdf").read_bytes())
    first = content[68:72]
    at = int.from_bytes(first, "little")
    content[at + 4 : at + 8] = first
    (tmp_path / "r.mdf").write_bytes(content)
    with pytest.raises(RecordError, match=r"r\.mdf is damaged \(a list of its blocks is a circle\)"):
        preview(tmp_path / "r.mdf")
