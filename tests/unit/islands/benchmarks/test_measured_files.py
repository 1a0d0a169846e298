"""Files of the benchmarks: official splits, and records as the files state them."""

import numpy as np
import pytest

from islands.benchmarks import measured_files
from islands.benchmarks.catalogue import MEASURED
from islands.benchmarks.definition import list_other_files, read_data
from islands.records.coupled import CoupledRecord
from support.repository import RECORDS, measured_record


def test_arrays_are_cut_at_the_rows_that_the_file_states(tmp_path):
    y = np.arange(1000.0)
    rows = {"idx_train": [400, 900], "idx_test": [100, 300]}
    np.savez(tmp_path / "wh2009.npz", u=-y, y=y, fs=np.float64(50.0), **rows)
    data = measured_files.read_wiener_hammerstein(tmp_path)
    assert (data.estimation.y[0], data.estimation.samples, data.estimation.dt) == (400.0, 500, 0.02)
    assert (data.tests["test"].record.u[0, 0], data.tests["test"].record.samples) == (-100.0, 200)
    assert (data.tests["test"].known, data.tests["test"].unscored) == (50, 50)


def test_the_periods_of_a_mirror_follow_each_other_and_levels_alternate(tmp_path):
    samples, rng, arrays = 8192, np.random.default_rng(0), {"fs": np.float64(6400.0)}
    for place, level in enumerate(("100mV", "200mV", "300mV"), start=1):
        for part, realisations in (("train", 2), ("test", 1)):
            for name in ("u", "y_um"):
                shape = (samples, 3, realisations, 2)
                arrays[f"{name}_{level}_{part}"] = place + 0.1 * rng.random(shape).astype(np.float32)
    np.savez(tmp_path / "fsm_piezo.npz", **arrays)
    data = measured_files.read_steering_mirror(tmp_path)
    record = data.estimation
    assert isinstance(record, CoupledRecord)
    assert record.segments == (2 * samples,) * 6
    assert [round(float(record.u[begin, 0])) for begin, _ in record.bounds] == [1, 2, 3, 1, 2, 3]
    test = data.tests["200mV"]
    assert (test.known, test.unscored) == (50, samples)
    for period in (0, 1):
        rows = slice(period * samples, (period + 1) * samples)
        assert np.array_equal(test.record.y[rows], arrays["y_um_200mV_test"][:, :, 0, period])


@pytest.mark.ci
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


@pytest.mark.ci
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
