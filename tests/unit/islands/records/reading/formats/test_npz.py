"""NumPy archives without a valid record are refused with a message that says what to do."""

import numpy as np
import pytest

from support.bad_records import archived, refusal


def test_channels_of_unequal_lengths_in_an_archive_are_refused_by_name(tmp_path):
    message = archived(tmp_path, y=np.arange(50.0))
    assert "bad.npz: column u has 60 samples, column y 50" in message


@pytest.mark.parametrize("shape", [(), (30, 2), (2, 30), (60, 1, 1)])
def test_an_array_of_another_shape_is_refused_with_its_shape(tmp_path, shape):
    message = archived(tmp_path, u=np.ones(shape))
    assert f"column u has the shape {shape}" in message
    assert "one array per channel and recording" in message


def test_an_array_of_objects_is_refused_without_unpickling(tmp_path):
    message = archived(tmp_path, u=np.array([1.0, None] * 30, dtype=object))
    assert "bad.npz: column u cannot be read" in message
    assert (
        "if it holds Python objects, which may run code, save it as numpy.asarray(values, float)" in message
    )


@pytest.mark.parametrize(
    ("u", "kind"),
    [(np.array(["", "b"] * 30), "text ('b' in sample 1)"), (np.ones(60, complex), "complex128")],
)
def test_an_array_of_text_or_complex_numbers_is_refused_with_its_type(tmp_path, u, kind):
    assert f"column u holds {kind} where real numbers are expected" in archived(tmp_path, u=u)


def test_an_archive_that_states_two_sampling_times_is_refused(tmp_path):
    message = archived(tmp_path, dt=0.01, fs=200.0)
    assert "0.01 s by array dt and 0.005 s by array fs" in message


@pytest.mark.parametrize("dt", [0.0, -1.0, np.nan, "fast"])
def test_an_archive_that_states_an_impossible_sampling_time_is_refused(tmp_path, dt):
    message = archived(tmp_path, dt=np.array(dt))
    assert "array dt states the sampling as" in message
    assert "fs in hertz" in message


@pytest.mark.parametrize(("content", "words"), [(b"", "is empty"), (b"u,y\n", "is not a NumPy archive")])
def test_a_file_of_another_format_is_refused(tmp_path, content, words):
    message = refusal(tmp_path, content, name="bad.npz")
    assert words in message
    assert "numpy.savez" in message


def test_a_damaged_archive_is_refused(tmp_path):
    file = tmp_path / "bad.npz"
    np.savez_compressed(file, u=np.random.default_rng(0).normal(size=500), y=np.arange(500.0), dt=0.01)
    content = bytearray(file.read_bytes())
    content[1000:1040] = bytes(40)
    message = refusal(tmp_path, bytes(content), inputs=["u"], output="y", name="bad.npz")
    assert "column u cannot be read" in message
    assert "the file is damaged, write it again" in message


def test_a_truncated_archive_is_refused(tmp_path):
    np.savez(tmp_path / "whole.npz", u=np.arange(500.0), y=np.arange(500.0), dt=0.01)
    content = (tmp_path / "whole.npz").read_bytes()
    # The directory at the end is kept, so that the file is still recognised as an archive.
    message = refusal(tmp_path, content[:200] + content[-230:], inputs=["u"], output="y", name="bad.npz")
    assert "bad.npz" in message
    assert "write it again" in message
