"""Split of records: the parts are disjoint, complete and from one system."""

from dataclasses import replace

import numpy as np
import pytest

from islands.errors import RecordError, SettingsError
from islands.records.dataset import Dataset, join
from islands.records.split import hold_out, split, split_data


def record(samples: int = 100, inputs: int = 1, **changes: object) -> Dataset:
    return Dataset(u=np.ones((samples, inputs)), y=np.arange(float(samples)), **({"dt": 0.1} | changes))


@pytest.mark.parametrize(("samples", "fraction"), [(100, 0.1), (101, 0.5), (7, 0.3), (2, 0.5)])
def test_parts_of_a_split_together_are_the_record_in_order(samples, fraction):
    parts = split(record(samples), fraction)
    both = np.concatenate([parts.estimation.y, parts.validation.y])
    assert both.tolist() == list(range(samples))


@pytest.mark.parametrize("fraction", [0.0, 1.0, -0.1, 1.5, float("nan")])
def test_fraction_outside_zero_and_one_is_refused(fraction):
    with pytest.raises(SettingsError, match=f"between 0 and 1, got {fraction}"):
        split(record(), fraction)


# Data for a search.


def drawn(samples: int = 50, seed: int = 0, **changes: object) -> Dataset:
    u, y = np.random.default_rng(seed).normal(size=(2, samples))
    return Dataset(u, y, 0.1, **changes)


def test_estimation_data_are_refused_as_validation_data():
    data = drawn()
    for validation in (
        data,
        replace(data, start=7.0),
        replace(data, output_name="y_val"),
        data[30:],
        data[:20],
    ):
        with pytest.raises(SettingsError, match="has samples that are used for estimation: give another"):
            split_data(data, validation)
    with pytest.raises(SettingsError, match="used for estimation"):
        split_data(data[10:40], data)


def test_samples_without_an_output_separate_segments_of_both_parts():
    data, other = drawn(), drawn(seed=1)
    y = other.y.copy()
    y[17:19] = np.nan
    holed = replace(other, y=y)
    for parts, cut in ((split_data(data, holed), 1), (split_data(holed, data), 0)):
        record = (parts.estimation, parts.validation)[cut]
        assert record.segments == (17, other.samples - 19)
        assert record.y.tolist() == [*other.y[:17], *other.y[19:]]
    assert split_data(holed, 0.2).estimation.segments == (17, round(0.8 * other.samples) - 19)


def test_every_recording_gives_its_end_to_the_validation_data():
    joined = join((drawn(seed=1)[:40], drawn(seed=2)[:20], drawn(seed=3)[:1]))
    parts = split(joined, 0.25)
    assert parts.estimation.rows_by_recording == {"1": slice(0, 30), "2": slice(30, 45), "3": slice(45, 46)}
    assert parts.validation.rows_by_recording == {"1": slice(0, 10), "2": slice(10, 15)}
    assert parts.validation.y.tolist() == [*drawn(seed=1).y[30:40], *drawn(seed=2).y[15:20]]


def test_recording_that_is_held_out_follows_the_others():
    first, second = record(300), record(100, start=50.0)
    joined = hold_out(first, second)
    assert (joined.samples, joined.held_out, joined.segments) == (400, 100, (300, 100))
    assert np.array_equal(joined.y[300:], second.y)
    assert [joined[rows].held_out for rows in (slice(0, 300), slice(250, 390), slice(300, 400))] == [0, 90, 0]


def test_recording_that_is_held_out_has_no_sample_of_the_others():
    whole = record(300)
    with pytest.raises(SettingsError, match="has samples of the record"):
        hold_out(whole, whole[100:200])


def test_part_that_is_held_out_begins_with_a_recording():
    with pytest.raises(RecordError, match="cannot be divided so that 50 are held out"):
        replace(join((record(300), record(100, start=50.0))), held_out=50)
