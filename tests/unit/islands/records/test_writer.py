"""Writing of records and simulations: files are read back exactly."""

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.records.reading import read_record
from islands.records.writer import write_record, write_simulation

NAMES = {"input_names": ("u_V", "T_K"), "output_name": "y_um"}


def record(samples=50, dt=0.01, **changes):
    rng = np.random.default_rng(3)
    return Dataset(rng.normal(size=(samples, 2)), rng.normal(size=samples), dt, **(NAMES | changes))


def read(path, **options):
    return read_record(path, ["u_V", "T_K"], "y_um", **options)


def test_a_record_is_read_back_exactly(tmp_path):
    written = record(start=1.25)
    write_record(written, tmp_path / "r.csv")
    found = read(tmp_path / "r.csv")
    assert np.array_equal(found.u, written.u)
    assert np.array_equal(found.y, written.y)
    assert (found.input_names, found.output_name) == (written.input_names, written.output_name)
    assert (found.input_units, found.output_unit) == (("V", "K"), "um")
    assert found.dt == pytest.approx(written.dt, rel=1e-12)
    assert found.start == 1.25
    assert found.segments == (50,)


@pytest.mark.parametrize(
    ("dt", "start"),
    [
        (1e-3, 0.0),
        (1 / 610.35, 0.0),
        (2e-8, 0.0),
        (3600.0, 0.0),
        (1e-3, 1.7e9),  # seconds since 1970
        (1e-6, -4e3),
        (0.1, 0.1 + 0.2),
    ],
)
def test_sampling_time_and_start_survive_at_any_ratio(dt, start, tmp_path):
    write_record(record(2000, dt, start=start), tmp_path / "r.csv")
    found = read(tmp_path / "r.csv")
    assert found.samples == 2000
    # A number of seconds near 2e9 has no digits beyond a quarter of a microsecond.
    assert found.dt == pytest.approx(dt, rel=1e-9, abs=np.spacing(abs(start)) / 1000)
    assert found.start == pytest.approx(start, rel=1e-12, abs=1e-6 * dt)


def test_several_recordings_do_not_fit_into_one_table(tmp_path):
    with pytest.raises(RecordError) as caught:
        write_record(record(segments=(20, 30)), tmp_path / "r.csv")
    assert str(caught.value) == "a CSV file holds one recording: write each segment to a separate file"
    assert not (tmp_path / "r.csv").exists()


def test_a_simulation_of_several_recordings_concatenates_their_samples(tmp_path):
    write_simulation(record(segments=(20, 30)), np.arange(50.0), tmp_path / "s.csv")
    table = np.genfromtxt(tmp_path / "s.csv", delimiter=",", names=True)
    assert table["time"].tolist() == pytest.approx((0.01 * np.arange(50)).tolist())
    assert table["y_sim"].tolist() == list(range(50))


@pytest.mark.parametrize("write", [write_record, lambda data, path: write_simulation(data, data.y, path)])
def test_an_unwritable_file_is_refused_with_its_path(write, tmp_path):
    with pytest.raises(RecordError) as caught:
        write(record(), tmp_path / "nowhere" / "r.csv")
    assert str(caught.value) == f"cannot write {tmp_path / 'nowhere' / 'r.csv'}: No such file or directory"
