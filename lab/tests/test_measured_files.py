"""Files of the benchmarks: official splits, and records as the files state them."""

import numpy as np
import pytest

from lab.published_sets.catalogue import MEASURED
from lab.published_sets.definition import list_other_files, read_data
from support.repository import RECORDS, measured_record


@pytest.mark.parametrize("name", MEASURED)
def test_a_measured_set_has_the_tests_and_samples_of_the_table(name):
    entry = MEASURED[name]
    for file in entry.files:
        measured_record(file)
    assert list_other_files(entry, RECORDS) == []
    data = read_data(name, entry, RECORDS)
    assert data.estimation.samples == entry.samples
    assert list(data.tests) == list(entry.published)
    for test in data.tests.values():
        record = test.record
        assert record.input_names == data.estimation.input_names
        assert record.dt == data.estimation.dt
        assert not np.isnan(record.y).any()


def test_the_official_splits_are_those_of_the_package():
    """nonlinear_benchmarks 1.0.1, ``benchmarks.py``: rows of the whole records."""
    for name, train, tests in (
        ("silverbox", (40_650, 105_712), {"multisine": (105_712, 127_400), "arrow": (100, 40_575)}),
        ("silverbox", (40_650, 105_712), {"arrow-no-extrapolation": (100, 32_100)}),
        ("wiener-hammerstein", (5_200, 105_200), {"test": (105_200, 184_000)}),
    ):
        (file,) = MEASURED[name].files
        with np.load(measured_record(file)) as arrays:
            y = arrays["y"].astype(float)
        data = read_data(name, MEASURED[name], RECORDS)
        assert np.array_equal(data.estimation.y, y[slice(*train)])
        for test, rows in tests.items():
            assert np.array_equal(data.tests[test].record.y, y[slice(*rows)])
            assert data.tests[test].known == 50
