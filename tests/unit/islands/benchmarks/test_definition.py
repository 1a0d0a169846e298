"""A benchmark hides the outputs that its rule does not allow, and says what its data lack."""

from pathlib import Path

import numpy as np
import pytest

from islands.benchmarks.definition import (
    Benchmark,
    BenchmarkData,
    BenchmarkTest,
    list_missing_files,
    list_other_files,
    read_data,
)
from islands.errors import RecordError, SettingsError, command_line_names
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset

#: SHA-256 of no bytes.
EMPTY = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"


def record(output="y", segments=(12, 8)):
    return Dataset(np.arange(20.0), np.arange(20.0), 0.1, output_name=output, segments=segments)


def benchmark(read, files=(("set.csv", EMPTY),)):
    return Benchmark("A set.", {"test": ()}, "V", 1.0, "a rule", "doi 10.1/2", "MIT", read, dict(files))


def test_outputs_after_the_initial_samples_of_each_segment_are_missing():
    visible = BenchmarkTest(record(), 3, 5).visible
    assert np.flatnonzero(~np.isnan(visible.y)).tolist() == [0, 1, 2, 12, 13, 14]
    assert visible.u.tolist() == record().u.tolist()


def test_all_outputs_are_hidden():
    visible = BenchmarkTest(CoupledRecord((record("y1"), record("y2"))), 3, 3).visible
    assert (~np.isnan(visible.y)).sum(axis=0).tolist() == [6, 6]


@pytest.mark.parametrize(("known", "unscored"), [(0, 3), (4, 3), (3, 8)])
def test_each_segment_has_initial_samples_and_scored_ones(known, unscored):
    with pytest.raises(RecordError, match="known <= unscored < samples"):
        BenchmarkTest(record(), known, unscored)


def test_a_missing_file_is_named_with_the_option_and_the_origin(tmp_path):
    entry = benchmark(lambda _folder: pytest.fail("read"))
    assert list_missing_files(entry, None) == list_missing_files(entry, tmp_path) == ["set.csv"]
    with command_line_names(), pytest.raises(SettingsError, match=r"set\.csv .*--data DIR.*doi 10\.1/2"):
        read_data("name", entry, tmp_path)


def test_a_file_of_another_content_is_listed(tmp_path):
    entry = benchmark(lambda _folder: None)
    (tmp_path / "set.csv").touch()
    assert list_other_files(entry, tmp_path) == []
    (tmp_path / "set.csv").write_text("1")
    assert list_other_files(entry, tmp_path) == ["set.csv"]


def test_a_file_without_the_columns_is_no_traceback(tmp_path):
    (tmp_path / "set.csv").touch()

    def read(folder: Path) -> BenchmarkData:
        assert folder == tmp_path
        raise KeyError("u_V")

    with pytest.raises(RecordError, match=r"set\.csv has another content than name needs: 'u_V'"):
        read_data("name", benchmark(read), tmp_path)
