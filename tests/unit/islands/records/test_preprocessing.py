import numpy as np
import pytest

from islands.errors import RecordError, SettingsError
from islands.records.dataset import Dataset, join
from islands.records.input_lead import advance_inputs
from islands.records.preprocessing import preprocess
from support.known_records import lag, measure, slow, white


@pytest.fixture
def record():
    u = 3.0 + slow(2000, 0)
    return Dataset(u, 5.0 + lag(u, 8.0), 0.1)


def test_steps_are_repeated_with_the_offsets_but_not_with_the_line(record):
    done = preprocess(record, detrend="linear", decimate=2)
    other = Dataset(record.u + 1.0, record.y + 2.0, record.dt)
    again = preprocess(other, like=done)
    plain = preprocess(other, decimate=2)
    found = done.preprocessing
    np.testing.assert_allclose(again.u[:, 0], plain.u[:, 0] - found.input_offsets[0])
    np.testing.assert_allclose(again.y, plain.y - found.output_offset)
    assert again.preprocessing == found


def test_a_filtered_linear_system_keeps_its_equation():
    u = slow(3000, 0)
    done = preprocess(measure(u, lag(u, 8.0)), lowpass=0.1)
    inner = slice(200, -200)
    np.testing.assert_allclose(done.y[inner], lag(done.u[:, 0], 8.0)[inner], atol=1e-6 * u.std())


def test_lowpass_removes_noise_and_keeps_the_signal():
    u = slow(3000, 0)
    noisy = measure(u, u, 0.1)
    done = preprocess(noisy, lowpass=0.05)
    assert np.std(done.y - u) < 0.5 * np.std(noisy.y - u)


def test_decimation_does_not_alias():
    k = np.arange(4000)
    fast = np.sin(2.0 * np.pi * 0.45 * k)
    assert np.abs(preprocess(Dataset(fast, fast, 1.0), decimate=4).y[50:-50]).max() < 0.01


@pytest.mark.parametrize(
    "wrong", [{"lowpass": -1.0}, {"lowpass": 5.0}, {"decimate": 0}, {"detrend": "square"}]
)
def test_values_out_of_range_are_errors(record, wrong):
    with pytest.raises(SettingsError):
        preprocess(record, **wrong)


def test_unsuitable_records_are_errors(record):
    done = preprocess(record, detrend="constant")
    with pytest.raises(RecordError, match="preprocessed before"):
        preprocess(done, detrend="constant")
    with pytest.raises(RecordError, match="2 segments"):
        preprocess(join((record, record)), detrend="linear")
    with pytest.raises(RecordError, match="too short for a filter"):
        preprocess(record[:10], decimate=2)
    with pytest.raises(RecordError, match="one sample early"):
        preprocess(advance_inputs(record, [0]), decimate=2)
    with pytest.raises(RecordError, match="sampling time"):
        preprocess(Dataset(white(100, 0), white(100, 1), 1.0), like=done)
