"""Properties of downsampling: few vertices, peaks and gaps are kept."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from islands.report.figures.downsampling import VERTICES, downsample

LONG = 100_000


def noise(samples: int = LONG) -> tuple[np.ndarray, np.ndarray]:
    return np.arange(samples, dtype=float), np.random.default_rng(0).standard_normal(samples)


def test_short_line_is_returned_unchanged():
    x, y = noise(VERTICES)
    assert downsample(x, y)[0] is x
    assert downsample(x, y)[1] is y


@pytest.mark.parametrize("samples", [VERTICES + 1, 3001, 99_999, LONG])
def test_long_line_keeps_at_most_the_requested_vertices(samples):
    kept = len(downsample(*noise(samples))[0])
    assert VERTICES / 2 < kept <= VERTICES


@pytest.mark.parametrize("sample", [0, 1, 199, 200, 54_321, LONG - 1])
@pytest.mark.parametrize("height", [50.0, -50.0])
def test_spike_of_a_single_sample_is_kept(sample, height):
    x, y = noise()
    y[sample] = height
    kept_x, kept_y = downsample(x, y)
    assert kept_y[kept_x == sample].tolist() == [height]


def test_columns_keep_their_first_last_smallest_and_largest_sample():
    x, y = noise()
    kept_x, kept_y = downsample(x, y, vertices=400)
    for column in range(100):
        there, kept = slice(1000 * column, 1000 * (column + 1)), kept_x // 1000 == column
        assert kept_x[kept][[0, -1]].tolist() == [there.start, there.stop - 1]
        assert (kept_y[kept].min(), kept_y[kept].max()) == (y[there].min(), y[there].max())


@settings(deadline=None)
@given(
    arrays(float, st.integers(50, 400), elements=st.floats(-1e6, 1e6) | st.just(np.nan)),
    st.integers(8, 40),
)
def test_kept_samples_are_ordered_and_include_the_extremes(y, vertices):
    x = np.arange(len(y), dtype=float)
    kept_x, kept_y = downsample(x, y, vertices)
    assert (np.diff(kept_x) > 0).all()
    np.testing.assert_array_equal(kept_y, y[kept_x.astype(int)])
    if not np.isnan(y).all():
        assert (np.nanmin(kept_y), np.nanmax(kept_y)) == (np.nanmin(y), np.nanmax(y))


@pytest.mark.parametrize("gap", [slice(500, 501), slice(30_000, 40_000), slice(199, 201), slice(0, 250)])
def test_gap_stays_open(gap):
    x, y = noise()
    y[gap] = np.nan
    kept_x, kept_y = downsample(x, y)
    inside = (kept_x >= gap.start) & (kept_x < gap.stop)
    assert inside.any()
    assert np.isnan(kept_y[inside]).all()
    assert not np.isnan(kept_y[~inside]).any()


def test_gap_at_the_end_of_a_column_is_not_bridged():
    x, y = noise()
    y[700:800] = np.nan  # the second half of a column of 200 samples
    kept_x, kept_y = downsample(x, y)
    assert np.isnan(kept_y[kept_x == 799]).all()
    assert (kept_x == 799).any()


def test_tips_of_a_loop_are_kept():
    angle = np.linspace(0, 6 * np.pi, 30_000)
    x, y = np.cos(angle), np.sin(angle + 0.3)
    kept_x, kept_y = downsample(x, y)
    assert (kept_x.max(), kept_x.min(), kept_y.max(), kept_y.min()) == (x.max(), x.min(), y.max(), y.min())
    # Consecutive vertices are at most one column apart on the loop.
    assert np.hypot(np.diff(kept_x), np.diff(kept_y)).max() < 0.06


def test_line_of_gaps_stays_a_gap():
    kept_x, kept_y = downsample(np.arange(5000.0), np.full(5000, np.nan))
    assert np.isnan(kept_y).all()
    assert len(kept_x) <= VERTICES
