"""Layout of shooting intervals: every predicted sample is in one lane, after its warm-up."""

import numpy as np
import pytest

from islands.errors import RecordError, SettingsError
from islands.kernels.simulate import WIDTHS
from islands.records.dataset import Dataset
from islands.simulation.layout import layout

SEGMENTS = (230, 4, 5, 120, 6)
WARM_UP = 5


@pytest.fixture
def record():
    # Every value identifies its sample: y is the index, the inputs are the index plus 1000 and plus 2000.
    y = np.arange(float(sum(SEGMENTS)))
    return Dataset(np.column_stack([y + 1000, y + 2000]), y, 0.1, segments=SEGMENTS)


def blocks(cut):
    """Yield the offset, the number of lanes, the starts and the lengths of the intervals of each block."""
    base = 0
    for offset, lanes in zip(cut.block_offset, cut.block_lanes, strict=True):
        yield offset, lanes, cut.start[base : base + lanes], cut.length[base : base + lanes]
        base += lanes
    assert base == len(cut.start)


@pytest.mark.parametrize("interval", [1, 2, 7, 100, None])
def test_every_sample_after_a_warm_up_belongs_to_one_interval(record, interval):
    cut = layout(record, WARM_UP, interval)
    covered = [
        k for start, length in zip(cut.start, cut.length, strict=True) for k in range(start, start + length)
    ]
    expected = [k for begin, end in record.bounds for k in range(begin + WARM_UP, end)]
    assert sorted(covered) == expected
    assert cut.length.max() <= (interval or record.samples)


@pytest.mark.parametrize("interval", [1, 2, 7, 100, None])
def test_blocks_fit_the_width_and_intervals_are_sorted_by_length(record, interval):
    cut = layout(record, WARM_UP, interval)
    assert cut.width in WIDTHS
    assert 1 <= cut.block_lanes.min() <= cut.block_lanes.max() <= cut.width
    for _, _, _, lengths in blocks(cut):
        assert (np.diff(lengths) <= 0).all()


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("interval", [2, 7, 100, None])
def test_gathered_row_only_contains_samples_of_the_record(monkeypatch, record, interval, width):
    monkeypatch.setattr("islands.simulation.layout.WIDTHS", (width,))
    cut = layout(record, WARM_UP, interval)
    assert cut.row_stride == cut.width == width
    assert np.isin(cut.signals[0], record.y).all()
    for channel, base in enumerate((0, 1000, 2000)):
        assert np.array_equal(cut.signals[channel], cut.signals[0] + base)
    # Unused lanes repeat the first, so they only diverge if it does.
    for offset, lanes, _, lengths in blocks(cut):
        block = cut.signals[0, offset : offset + (WARM_UP + lengths[0]) * width].reshape(-1, width)
        assert np.array_equal(block[:, lanes:], np.repeat(block[:, :1], width - lanes, axis=1))


@pytest.mark.parametrize("interval", [0, -3])
def test_interval_without_a_sample_is_refused(record, interval):
    with pytest.raises(SettingsError, match=f"^a shooting interval has at least 1 sample, got {interval}$"):
        layout(record, WARM_UP, interval)


def test_recordings_that_are_all_too_short_are_refused(record):
    with pytest.raises(RecordError) as caught:
        layout(record, 230)
    assert "longest recording has 230 samples" in str(caught.value)
    assert "take a longer recording" in str(caught.value)
    assert layout(record, 229).length.tolist() == [1]


@pytest.mark.parametrize(
    ("sample", "interval"), [(239, None), (241, None), (243, None), (239, 1), (300, 1), (357, 1), (343, 100)]
)
def test_missing_output_in_the_warm_up_of_an_interval_is_refused(record, sample, interval):
    y = record.y.copy()
    y[sample] = np.nan
    gap = Dataset(record.u, y, 0.1, segments=SEGMENTS)
    with pytest.raises(RecordError, match=f"^the output is missing at sample {sample}, where a simulation"):
        layout(gap, WARM_UP, interval)
