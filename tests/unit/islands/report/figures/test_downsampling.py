"""Properties of downsampling: few vertices, peaks and gaps are kept."""

import numpy as np
import pytest

from islands.report.figures.downsampling import VERTICES, downsample

LONG = 100_000


def noise(samples: int = LONG) -> tuple[np.ndarray, np.ndarray]:
    return np.arange(samples, dtype=float), np.random.default_rng(0).standard_normal(samples)


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


@pytest.mark.parametrize("gap", [slice(500, 501), slice(30_000, 40_000), slice(199, 201), slice(0, 250)])
def test_gap_stays_open(gap):
    x, y = noise()
    y[gap] = np.nan
    kept_x, kept_y = downsample(x, y)
    inside = (kept_x >= gap.start) & (kept_x < gap.stop)
    assert inside.any()
    assert np.isnan(kept_y[inside]).all()
    assert not np.isnan(kept_y[~inside]).any()
