"""Recordings of a command: joined in the given order, with validation data from each or from another file."""

import numpy as np
import pytest

from islands.cli.recordings import Recordings
from islands.errors import RecordError, SettingsError
from islands.records.dataset import Dataset
from islands.records.input_lead import advance_inputs
from islands.records.preprocessing_steps import PreprocessingSteps
from islands.records.writer import write_record


def record(samples=120, seed=0):
    u, y = np.random.default_rng(seed).normal(size=(2, samples))
    return Dataset(u, y, 0.01, ("u_V",), "y_um")


@pytest.fixture
def files(tmp_path):
    write_record(record(), tmp_path / "r.csv")
    write_record(record(60, 1), tmp_path / "s.csv")
    return tmp_path


def recordings(files, *names):
    return Recordings([files / name for name in names], ["u_V"], ["y_um"])


def test_recordings_are_joined_in_the_given_order(files):
    found = recordings(files, "s.csv", "r.csv").read("10:50")
    assert found.rows_by_recording == {"s.csv": slice(0, 40), "r.csv": slice(40, 80)}
    assert np.array_equal(found.y, np.concatenate([record(60, 1).y[10:50], record().y[10:50]]))


def test_validation_is_a_file_a_fraction_or_rows(files):
    one = recordings(files, "r.csv")
    assert one.read_held_out(None) == 0.25
    assert one.read_held_out("0.4", "0:80") == 0.4
    assert np.array_equal(one.read_held_out(str(files / "s.csv"), "0:80").y, record(60, 1).y)
    assert np.array_equal(one.read_held_out("80:", "0:80").y, record().y[80:])
    assert recordings(files, "r.csv", "s.csv").read_held_out("30:", "0:30").segments == (90, 30)
    with pytest.raises(SettingsError) as caught:
        one.read_held_out("nowhere.csv", "0:80")
    assert str(caught.value) == (
        "--validation nowhere.csv: give a file that exists, a fraction such as 0.25, or rows START:STOP"
    )
    with pytest.raises(RecordError, match="is a folder: give the path of the file in it"):
        one.read_held_out(str(files), "0:80")


@pytest.mark.parametrize("steps", [{"decimate": 3}, {"lowpass": 20.0, "detrend": "constant"}], ids=str)
def test_an_input_is_read_early_behind_the_filter(files, steps):
    """A model of ``u_V+1`` filters a measured record and advances the input after it."""
    paths, given = [files / "r.csv"], PreprocessingSteps(**steps)
    found = Recordings(paths, ["u_V+1"], ["y_um"], steps=given)
    expected = Recordings(paths, ["u_V"], ["y_um"], steps=given)
    for own, other in (
        (found.read(), expected.read()),
        (found.read_held_out("80:", "0:80"), expected.read_held_out("80:", "0:80")),
    ):
        assert own.input_names == ("u_V+1",)
        advanced = advance_inputs(other, (0,))
        assert np.array_equal(own.u, advanced.u)
        assert np.array_equal(own.y, advanced.y)
        assert own.preprocessing == other.preprocessing


@pytest.mark.parametrize(
    ("text", "used"), [("80:", None), ("80:", "0:81"), ("0:90", "80:"), ("50:60", "0:100"), (":", "0:10")]
)
def test_validation_rows_must_not_overlap_estimation_rows(files, text, used):
    with pytest.raises(SettingsError, match="give --rows START:STOP, other samples for estimation"):
        recordings(files, "r.csv").read_held_out(text, used)
