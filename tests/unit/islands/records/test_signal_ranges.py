"""Ranges of signals, and what leaves them."""

import numpy as np

from islands.records.dataset import Dataset
from islands.records.signal_ranges import compare_ranges, measure_ranges


def measure(gain: float, slow: int = 1, channels: int = 0):
    t = np.arange(400 * slow) * 0.1 / slow
    u = np.column_stack([gain * np.sin(t), *[np.cos(t)] * channels])
    names = ("u_V", "w_N")[: 1 + channels]
    return measure_ranges(
        Dataset(u, u[:, 0], 0.1, names, "y_um", ("V", "N")[: 1 + channels], "um"), 2.0 * u[:, 0]
    )


def test_ranges_are_those_of_inputs_and_output():
    u, y = measure(1.0)
    np.testing.assert_allclose((u.low, u.high, u.rate), (-1.0, 1.0, 1.0), rtol=0.01)
    np.testing.assert_allclose((y.low, y.high, y.rate), (-2.0, 2.0, 2.0), rtol=0.01)
    assert (u.name, u.unit, y.name, y.unit) == ("u_V", "V", "y_um", "um")


def test_a_larger_signal_is_stated_with_both_ranges():
    statements = compare_ranges(measure(1.0), measure(1.1))
    where = "where the extended simulation was tested"
    assert statements == [
        f"u_V is -1.1 to 1.1 V in the record, and was -1 to 1 V {where}",
        f"y_um is -2.2 to 2.2 um in the record, and was -2 to 2 um {where}",
    ]


def test_a_faster_signal_is_stated_with_both_rates():
    statements = compare_ranges(measure(1.0, slow=2), measure(1.0))
    assert len(statements) == 2
    assert statements[0].startswith("u_V changes by up to 0.9996 V/s")
    assert "and by up to 0.4999 V/s" in statements[0]


def test_a_recording_does_not_change_at_its_border():
    u = np.repeat([0.0, 5.0], 100)
    record = Dataset(u, u, 0.1, segments=(100, 100))
    assert [each.rate for each in measure_ranges(record, u)] == [0.0, 0.0]


def test_a_diverged_output_has_no_range():
    record = Dataset(np.ones(10), np.ones(10), 0.1)
    ranges = measure_ranges(record, np.full(10, np.nan))
    assert np.isnan(ranges[1].low)
    assert compare_ranges(measure_ranges(record, np.ones(10)), ranges) == []
