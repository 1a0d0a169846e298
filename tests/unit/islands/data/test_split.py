"""Split of records: the parts are disjoint, complete and from one system."""

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.data.split import Split, split
from islands.errors import RecordError, SettingsError


def record(samples: int = 100, inputs: int = 1, **changes: object) -> Dataset:
    return Dataset(u=np.ones((samples, inputs)), y=np.arange(float(samples)), **({"dt": 0.1} | changes))


def test_default_validation_part_is_a_quarter_of_the_record():
    parts = split(record())
    assert (parts.estimation.samples, parts.validation.samples) == (75, 25)


@pytest.mark.parametrize(("samples", "fraction"), [(100, 0.1), (101, 0.5), (7, 0.3), (2, 0.5)])
def test_parts_of_a_split_together_are_the_record_in_order(samples, fraction):
    parts = split(record(samples), fraction)
    both = np.concatenate([parts.estimation.y, parts.validation.y])
    assert both.tolist() == list(range(samples))


def test_validation_part_is_the_end_of_the_record_and_keeps_its_time():
    parts = split(record(start=2.0), 0.2)
    assert parts.validation.y[0] == 80.0
    assert parts.validation.start == pytest.approx(10.0)
    assert parts.estimation.start == 2.0


def test_segment_across_the_split_boundary_is_cut():
    parts = split(record(segments=(50, 40, 10)), 0.25)
    assert parts.estimation.segments == (50, 25)
    assert parts.validation.segments == (15, 10)


@pytest.mark.parametrize("fraction", [0.0, 1.0, -0.1, 1.5, float("nan")])
def test_fraction_outside_zero_and_one_is_refused(fraction):
    with pytest.raises(SettingsError, match=f"between 0 and 1, got {fraction}"):
        split(record(), fraction)


@pytest.mark.parametrize("fraction", [0.001, 0.999])
def test_fraction_that_leaves_a_part_empty_is_refused(fraction):
    with pytest.raises(SettingsError, match=f"{fraction} of 100 samples leaves a part empty"):
        split(record(), fraction)


def test_validation_inputs_take_the_order_of_the_estimation_data():
    columns = np.arange(6.0).reshape(3, 2)
    estimation = Dataset(columns, np.zeros(3), 0.1, ("a", "b"))
    parts = Split(estimation, Dataset(columns[:, ::-1], np.ones(3), 0.1, ("b", "a")))
    assert parts.validation.u.tolist() == columns.tolist()
    assert parts.validation.input_names == ("a", "b")


def test_parts_that_do_not_match_are_refused():
    with pytest.raises(
        RecordError, match=r"estimation data has a sampling time of 0\.1 s, the validation data"
    ):
        Split(record(), record(dt=0.1005))
