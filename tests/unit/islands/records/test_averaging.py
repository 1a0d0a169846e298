"""Means of consecutive samples, and models of them."""

from dataclasses import replace

import numpy as np
import pytest

from islands.errors import RecordError, SettingsError
from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.records.averaging import average_samples, check_average, count_means
from islands.records.dataset import Dataset
from islands.records.signal_map import match_rate


def ramp(samples=11, **changes):
    """Return a record of y = 10 k and the inputs k and -k."""
    k = np.arange(float(samples))
    return Dataset(np.column_stack([k, -k]), 10.0 * k, **({"dt": 0.5, "start": 2.0} | changes))


def test_a_mean_has_the_middle_of_its_samples():
    means = average_samples(ramp(), 3)
    assert means.y.tolist() == [10.0, 40.0, 70.0]
    assert means.u.tolist() == [[1.0, -1.0], [4.0, -4.0], [7.0, -7.0]]
    assert (means.dt, means.segments) == (1.5, (3,))
    assert means.time.tolist() == [2.5, 4.0, 5.5]


def test_no_mean_contains_samples_of_two_segments():
    record = ramp(segments=(5, 6))
    means = average_samples(record, 2)
    assert means.segments == (2, 3)
    assert means.y.tolist() == [5.0, 25.0, 55.0, 75.0, 95.0]
    parts = [average_samples(part, 2).y for part in (record[:5], record[5:])]
    assert means.y.tolist() == np.concatenate(parts).tolist()


@pytest.mark.parametrize(
    ("samples", "count", "means"), [(500, 1, 500), (500, 20, 25), (52, 5, 10), (3, 20, 1)]
)
def test_an_interval_has_as_many_means_as_fill_its_time(samples, count, means):
    assert count_means(samples, count) == means


@pytest.mark.parametrize(
    ("record", "count", "error", "message"),
    [
        (ramp(), 0, SettingsError, "at least 1 sample, got 0"),
        (
            ramp(segments=(2, 2, 2, 2, 2, 1)),
            3,
            RecordError,
            "a recording of 2 samples has no mean of 3: .*longer",
        ),
        (ramp(input_names=("a", "b+1")), 3, RecordError, r"b\+1 is read one sample early.*without \+1"),
    ],
)
def test_invalid_means_are_refused(record, count, error, message):
    with pytest.raises(error, match=message):
        average_samples(record, count)


@pytest.mark.parametrize("average", [0, -1, "0", "fast", "2.5", ""])
def test_an_invalid_setting_is_refused(average):
    with pytest.raises(SettingsError, match="average is auto or a number of samples from 1 on"):
        check_average(average)


@pytest.mark.parametrize(
    ("dt", "average", "averaged"),
    [(1.5, 3, True), (0.5, 3, False), (1.0, 3, False), (0.5, 1, False), (None, 3, False)],
)
def test_a_record_is_averaged_only_for_a_model_of_means_of_its_rate(dt, average, averaged):
    model = replace(make_model([(parse("u(k-1)"), 1.0)], dt=dt), average=average)
    record = ramp()
    matched = match_rate(model, record)
    assert (matched is not record) == averaged
    assert matched.dt == (1.5 if averaged else 0.5)
