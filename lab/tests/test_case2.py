"""Case 2: the layouts of the measured records, the drift, and the record in their place."""

import numpy as np
import pytest

from islands.records.dataset import Dataset
from lab.reproduction.case2 import remove_drift, simulate_substitute, take_record


@pytest.fixture(scope="module")
def rig():
    """Return the record in place of the measured one, with offsets and a drift."""
    record = simulate_substitute(1600)
    return Dataset(record.u + 0.3, record.y + 4.0 + 20.0 * record.time, record.dt, ("u_V",), "y_um")


def write(path, rig, header, index=True, start=0.0):
    time = start + rig.dt * np.arange(rig.samples)
    columns = [time, rig.y, rig.u[:, 0]]
    columns = [np.arange(rig.samples), *columns] if index else columns
    lines = [header] * bool(header) + [
        ",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


@pytest.mark.parametrize("header", ["index,time,output,input", ",time,output,input", ""])
def test_the_file_of_the_owners_is_read_with_and_without_a_header(tmp_path, rig, header):
    taken = take_record(write(tmp_path / "h50us.csv", rig, header), quick=False)
    assert taken.record.samples == rig.samples
    assert taken.record.dt == pytest.approx(5e-5)
    assert np.corrcoef(taken.record.u[:, 0], rig.u[:, 0])[0, 1] == pytest.approx(1.0)
    assert not taken.simulated
    assert "h50us.csv" in taken.source


@pytest.mark.parametrize("cycles", [3.0, 5.25, 8.0])
def test_drift_is_removed_although_the_sine_has_few_or_broken_periods(cycles):
    """The sine tilts a line that is fitted alone."""
    t = np.arange(2000) / 2000
    u = np.sin(2 * np.pi * cycles * t)
    delayed = 3.0 * np.sin(2 * np.pi * cycles * t - 0.3)
    clean = remove_drift(Dataset(u + 2.0, delayed + 7.0 - 1.5 * t, 1 / 2000))
    assert np.ptp(clean.y - delayed) < 1e-3 < abs(np.polyfit(t, delayed, 1)[0])
    assert clean.u.mean() == pytest.approx(0.0, abs=1e-12)
